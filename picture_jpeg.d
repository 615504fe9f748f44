picture_jpeg.o: trainer/capture/files/picture_jpeg.c \
  trainer/capture/files/picture_kinds.h trainer/capture/files/picture.h \
  trainer/capture/views/capture.h trainer/basics/error.h \
  trainer/basics/alloc.h trainer/basics/file.h

trainer/capture/files/picture_kinds.h:

trainer/capture/files/picture.h:

trainer/capture/views/capture.h:

trainer/basics/error.h:

trainer/basics/alloc.h:

trainer/basics/file.h:
