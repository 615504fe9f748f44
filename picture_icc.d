picture_icc.o: trainer/capture/files/picture_icc.c \
  trainer/capture/files/picture_kinds.h trainer/capture/files/picture.h \
  trainer/capture/views/capture.h trainer/basics/error.h

trainer/capture/files/picture_kinds.h:

trainer/capture/files/picture.h:

trainer/capture/views/capture.h:

trainer/basics/error.h:
