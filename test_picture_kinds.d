test_picture_kinds.o: tests/capture/test_picture_kinds.c \
  tests/support/capture_files.h trainer/capture/read/capture_load.h \
  trainer/capture/views/capture.h trainer/basics/error.h \
  trainer/basics/file.h tests/support/testing.h tests/support/freed.h \
  trainer/capture/files/picture.h

tests/support/capture_files.h:

trainer/capture/read/capture_load.h:

trainer/capture/views/capture.h:

trainer/basics/error.h:

trainer/basics/file.h:

tests/support/testing.h:

tests/support/freed.h:

trainer/capture/files/picture.h:
