# SPDX-License-Identifier: MIT
#
# Builds, tests and installs saga. `make help` lists the targets and the
# variables.
#
# The files of a folder may include only headers of these folders (see
# docs/architecture.md), which the folder's -I options enforce:
#   common   common
#   decoder  common, decoder
#   trainer  common, saga.h (copied to build/include), and for each room, that
#            is, folder of the trainer, the rooms in its SEE_room below; cli
#            also verify.h of reference
#   tools, ports  saga.h; ports/windows also dec_output.h of tools
#   reference  common, decoder, and basics and code of the trainer
#   tests, lab, bench  all folders
#
# Everything is built under BUILD. If the compiler or a flag has changed,
# everything is built again. Each configuration that is to be kept needs a
# folder of its own:
#   make BUILD=build/clang CC=clang OPT=-O3

QUIET := $(findstring s,$(firstword -$(MAKEFLAGS)))# make -s
MAKEFLAGS += --no-builtin-rules
.SUFFIXES:
.DELETE_ON_ERROR:

ifeq ($(origin CC),default)
CC = gcc
endif
ifeq ($(origin AR),default)
AR = ar
endif

BUILD = build
LEVEL = 2# level whose memory block saga-dec reserves
OPT = -O2
HOT_OPT = $(if $(filter -O2,$(OPT)),-O3,$(OPT))
WERROR =# tests set it to -Werror
CFLAGS =# added to every compilation, after this file's flags
CORE_CFLAGS =# added to compilations of common/ and decoder/
LDFLAGS =# added to every link, before the objects
SANITIZE =# 1: ASan and UBSan, and fx.h's checks; quick: fewer for the trainer
REAL =# double: the trainer computes in double, for tests
ARGS =# selects parts of `make bench` or `make rd`
V =# 1: prints every command, not one line for each file

# The folders of `make install`; DESTDIR is put before each of them.
PREFIX = /usr/local
BINDIR = $(PREFIX)/bin
LIBDIR = $(PREFIX)/lib
INCLUDEDIR = $(PREFIX)/include
DATADIR = $(PREFIX)/share
PYTHONDIR = $(DATADIR)/saga/python
DESTDIR =

# The inner loops of the decoder are compiled with HOT_OPT.
HOT = $(addprefix common/,context fine syntax_segment interp mlp mlp_avx2 \
                  fx_math sine_avx2 nets memory_bank) decoder/range_dec \
      $(addprefix decoder/,reconstruct raster raster_list raster_write \
                  blend) \
      $(addprefix decoder/arch/blend_,avx2 sse4 neon) \
      $(addprefix decoder/arch/splats_,avx2 neon)

# check_vectors is built for every machine that has libc and libm. It links only
# these files of the trainer, which need no other library.
PLAIN_TRAINER = $(addprefix trainer/code/,cost.c range_enc.c look_up.c \
                  encode.c encode_chunks.c) \
                $(addprefix trainer/basics/,alloc.c error.c utf8.c)

# SEE_room lists the rooms whose headers a room of the trainer may include, all
# of them earlier in ROOMS. docs/architecture.md has the same table;
# tests/check_tree.sh compares both.
ROOMS := basics nn $(addprefix capture/,views files loaders read survey synth) \
         code splat rig gpu scene entropy warm \
         $(addprefix train/,plan fit pack run) film measure exchange cli
SEE_basics        :=
SEE_nn            := basics
SEE_capture/views := basics
SEE_capture/files := basics capture/views
SEE_capture/loaders := basics capture/views capture/files
SEE_capture/read  := basics capture/views capture/files capture/loaders
SEE_capture/survey := basics capture/views
SEE_capture/synth := basics capture/views capture/files
SEE_code          := basics
SEE_splat         := basics
SEE_rig           := basics capture/views splat
SEE_gpu           := basics nn capture/views splat rig
SEE_scene         := basics nn code splat
SEE_entropy       := basics nn code splat scene
SEE_warm          := basics nn capture/views capture/survey splat rig gpu
SEE_train/plan    := basics capture/views code splat rig gpu warm
SEE_train/fit     := basics nn capture/views code splat rig gpu scene entropy train/plan
SEE_train/pack    := basics nn capture/views code splat rig gpu scene entropy train/plan train/fit
SEE_train/run     := basics nn capture/views code splat rig gpu scene entropy warm train/plan train/fit train/pack
SEE_film          := basics capture/views code rig
SEE_measure       := basics capture/views capture/files capture/survey rig film
SEE_exchange      := basics capture/views capture/files splat rig film
SEE_cli           := basics nn capture/views capture/files capture/loaders capture/read capture/survey capture/synth code splat rig gpu scene warm train/plan train/pack train/run film measure exchange

# ---------------------------------------------------------------- sources

COMMON_SRC  := $(sort $(wildcard common/*.c))
DECODER_SRC := $(sort $(wildcard decoder/*.c decoder/*/*.c))
TRAINER_SRC := $(sort $(wildcard trainer/*/*.c trainer/*/*/*.c))
CLI_SRC     := $(filter trainer/cli/%,$(TRAINER_SRC))
TOOLS_SRC   := $(sort $(wildcard tools/*.c))
TESTS_SRC   := $(sort $(wildcard tests/*/test_*.c))
REFERENCE_SRC := $(sort $(wildcard reference/*.c))
HELPER_SRC  := $(sort $(wildcard tests/support/*.c lab/gen_*.c))
BENCH_SRC   := $(sort $(wildcard bench/bench_*.c))

OBJ = $(BUILD)/obj
obj = $(patsubst %.c,$(OBJ)/%.o,$(1))
COMMON_OBJ  := $(call obj,$(COMMON_SRC))
DECODER_OBJ := $(call obj,$(DECODER_SRC))
TRAINER_OBJ := $(call obj,$(filter-out $(CLI_SRC),$(TRAINER_SRC)))
CLI_OBJ     := $(call obj,$(CLI_SRC))

# The trainer's floating-point operators are compiled a second time in double,
# for finite differences and references in tests. Their objects are under f64,
# and their symbols end with _f64.
FLOAT_SRC := $(sort $(foreach r,basics nn splat rig scene entropy warm train/*,\
                 $(wildcard trainer/$(r)/*.c)))
TWICE_SRC := $(filter-out $(addprefix trainer/,scene/hierarchy.c scene/tree.c \
               scene/budget.c scene/medoid.c entropy/rate_bits.c \
               entropy/rate_choice.c),$(filter trainer/nn/% \
               trainer/splat/% trainer/scene/% trainer/entropy/%,$(FLOAT_SRC))) \
               trainer/code/quantise.c trainer/code/quantise_nets.c
F64_OBJ   := $(TWICE_SRC:%.c=$(OBJ)/f64/%.o)

# Those that compute with vectors are compiled for further levels of x86-64, of
# which the program chooses one when it starts (trainer/basics/isa.h).
ISA_SRC := $(shell grep -lE '"(vec|wide|splat_lanes|raster_tile).h"' $(TRAINER_SRC)) \
           trainer/capture/views/filmed.c
MACHINE := $(shell $(CC) $(CFLAGS) -dumpmachine)
ISA_LEVELS := $(if $(filter x86_64%,$(MACHINE)),3 4)
ISA_OBJ := $(foreach n,$(ISA_LEVELS),$(patsubst %.c,$(OBJ)/v$(n)/%.o,\
             $(if $(filter double,$(REAL)),\
               $(filter-out $(TWICE_SRC),$(ISA_SRC)),$(ISA_SRC))))
HELPER_OBJ := $(call obj,$(HELPER_SRC))
REFERENCE_OBJ := $(call obj,$(REFERENCE_SRC))
EVERY_OBJ := $(F64_OBJ) $(ISA_OBJ) $(call obj,$(COMMON_SRC) $(DECODER_SRC) $(TRAINER_SRC) \
               $(REFERENCE_SRC) $(TOOLS_SRC) $(sort $(wildcard tests/*/*.c lab/*.c bench/*.c)))

# The programs that do without other libraries are also built for Windows: one
# file of tools/ is replaced, and others are added, by those of ports/windows.
EXE := $(if $(findstring mingw,$(MACHINE)),.exe)
WINDOWS_OBJ := $(if $(EXE),$(addprefix $(OBJ)/ports/windows/,windows_start.o windows.o))
DEC_OBJ := $(OBJ)/tools/dec_options.o $(WINDOWS_OBJ) \
           $(OBJ)/$(if $(EXE),ports/windows/output_windows,tools/dec_output).o
CLOCK := $(if $(EXE),-pthread)# where MinGW-w64 has clock_gettime

LIB     = $(BUILD)/libsaga.a
SHARED  = $(BUILD)/libsaga.so.0
TRAIN   = $(BUILD)/libtrainer.a
TWICE   = $(BUILD)/libtwice.a
PLAIN   = $(BUILD)/libplain.a
REFERENCE = $(BUILD)/libreference.a
HELPERS = $(BUILD)/libhelpers.a
SAGA_H  = $(BUILD)/include/saga.h
REFERENCE_H = $(BUILD)/include/verify.h

TOOLS = $(addprefix $(BUILD)/,saga-dec$(EXE) saga-play$(EXE) saga gen_tables)
TESTS := $(addprefix $(BUILD)/,$(notdir $(TESTS_SRC:.c=)))
# Programs for the scripts of lab/. Those for files set coarse features to zero,
# fit the entropy networks again, count the bytes of an order-0 coder, measure
# the times of parts, try number formats, and recover masked anchors. make_paper
# trains the paper's model without its parts.
LAB := $(addprefix $(BUILD)/,make_zeroed make_order0 make_refit make_times \
         make_formats make_masked make_paper)
# bench_table times operators, and bench_numerics the decoder's in several number
# formats.
BENCH := $(addprefix $(BUILD)/,bench_table bench_numerics)
BENCH_OBJ := $(call obj,$(filter-out bench/bench_numerics.c,$(BENCH_SRC)))

# ---------------------------------------------------------------- flags

WARN = -Wall -Wextra -Wconversion -Wshadow -Wundef -Wcast-align \
       -Wstrict-prototypes -Wmissing-prototypes -Wvla $(WERROR)
SAN_ALL   = -g1 -fsanitize=address -fsanitize=undefined \
            -fno-sanitize-recover=all -fno-omit-frame-pointer
SAN_FLAGS = $(if $(SANITIZE),$(SAN_ALL))
# With SANITIZE=quick the trainer does without UBSan's checks of every access by
# a pointer, which double the time of its compilation; ASan's remain. What takes
# longer to optimise than to run is not optimised.
SAN_LESS = $(if $(filter quick,$(SANITIZE)),$(addprefix -fno-sanitize=,\
             alignment null object-size pointer-overflow))
SAN_DEFS  = $(if $(SANITIZE),-DSAGA_CHECK)
BASE = -std=c11 $(WARN) $(SAN_DEFS) -MMD -MP

# common/ and decoder/ are freestanding and use only integers.
CORE = $(BASE) -ffreestanding $(CORE_CFLAGS)
# Other code uses POSIX and, for locks, flock, which macOS declares only with
# _DARWIN_C_SOURCE. The compiler must not contract or reassociate its
# floating-point operations.
HOST = $(BASE) -D_XOPEN_SOURCE=700 -D_DARWIN_C_SOURCE -ffp-contract=off \
       $(if $(EXE),-D_FILE_OFFSET_BITS=64 -include ports/windows/posix.h)

# Without libqrencode `saga view --host` prints an address without a code.
QR := $(shell pkg-config --libs libqrencode 2>/dev/null)
$(OBJ)/trainer/cli/view_code.o: QR_FLAG = $(if $(QR),-DSAGA_QRENCODE)

# OpenMP is used where the compiler can link it (Debian's clang cannot without
# libomp). Results do not depend on the number of threads.
OPENMP := $(shell printf 'int main(void){return 0;}' | $(CC) -fopenmp -x c \
            - -o /dev/null 2>/dev/null && echo -fopenmp)
OMP = $(if $(OPENMP),$(OPENMP),-Wno-unknown-pragmas)

comma := ,
AS_NEEDED = $(if $(filter Darwin,$(shell uname -s)),,-Wl$(comma)--as-needed)
HOST_LIBS = $(AS_NEEDED) $(QR) -lOpenEXRCore $(shell pkg-config --libs jansson \
              libpng libtiff-4 libturbojpeg libwebp libzstd \
              zlib 2>/dev/null || \
              echo -ljansson -lpng -ltiff -lturbojpeg -lwebp -lzstd -lz) -lm
# -isystem suppresses warnings in the headers of OpenEXR.
EXR_INC   = $(patsubst -I%,-isystem %,$(shell pkg-config --cflags-only-I \
              OpenEXR 2>/dev/null))
CMOCKA    = $(AS_NEEDED) -lcmocka
# Programs that are not installed are linked by lld, which takes a third of the
# time of binutils' linker.
LLD := $(and $(filter Linux,$(shell uname -s)),$(shell command -v ld.lld),-fuse-ld=lld)

# The first line of a recipe, which says what is made.
say = $(if $(V)$(QUIET),,@printf '%-5s %s\n' $(1) $@)
ifeq ($(V),)
.SILENT:
endif

COMPILE = $(CC) $(1) $(OPT_LEVEL) $(SAN_FLAGS) $(CFLAGS)
LINK    = $(CC) $(OPT) $(SAN_FLAGS) $(CFLAGS) $(LDFLAGS)

OPT_LEVEL = $(OPT)
$(foreach f,$(HOT),$(OBJ)/$(f).o $(OBJ)/pic/$(f).o): OPT_LEVEL = $(HOT_OPT)
# SSE2 has no arithmetic shift of 64 bits: gcc's vector code is a tenth slower.
$(OBJ)/decoder/project.o $(OBJ)/pic/decoder/project.o: OPT_LEVEL = $(HOT_OPT) -fno-tree-vectorize
# Tests run for less time than it takes to optimise them.
$(call obj,$(TESTS_SRC)): OPT_LEVEL = $(OPT:-O2=-O0)
$(FLOAT_SRC:%.c=$(OBJ)/%.o) $(F64_OBJ) $(ISA_OBJ): OPT_LEVEL = $(HOT_OPT)
$(addprefix $(OBJ)/trainer/measure/,conv.o metrics.o yuv.o): OPT_LEVEL = $(HOT_OPT)
ifeq ($(SANITIZE),quick)
$(filter-out $(OBJ)/trainer/code/%,$(TRAINER_OBJ)) $(ISA_OBJ) $(CLI_OBJ) \
    $(call obj,$(TESTS_SRC)): OPT_LEVEL = -O0
endif
$(ISA_SRC:%.c=$(OBJ)/%.o): ISA = -DSAGA_ISA=1
$(TRAINER_SRC:%.c=$(OBJ)/%.o) $(ISA_OBJ): SAN_FLAGS += $(SAN_LESS)

I_COMMON  = -Icommon -Icommon/arch
I_DECODER = -Icommon -Idecoder
I_SAGA    = -I$(BUILD)/include
# The metrics of trainer/measure stay in float if the trainer uses double.
DOUBLE = $(if $(filter double,$(REAL)),$(if $(filter measure/%,$*),,\
           -DSAGA_REAL_DOUBLE))
# $* is the source without its suffix.
I_CORE    = $(if $(filter common/%,$*),$(I_COMMON),$(I_DECODER))
I_WASM    = $(if $(filter ports/%,$*),$(I_SAGA),$(I_CORE))
# $* is the file's path below trainer/: its room, and its name.
I_ROOM    = -Icommon $(I_SAGA) $(foreach r,$(patsubst %/,%,$(dir $*)),\
              $(patsubst %,-Itrainer/%,$(r) $(SEE_$(r)))) $(EXR_INC)
I_REFERENCE = $(I_DECODER) -Itrainer/basics -Itrainer/code
I_ALL     = $(I_COMMON) -Idecoder $(ROOMS:%=-Itrainer/%) -Ireference \
            -Itests/support -Ilab

# ---------------------------------------------------------------- build

.PHONY: all lib shared windows tests lab-programs bench-programs objects web help
all: lib $(TOOLS) web
lib: $(LIB)
shared: $(SHARED)
tests: $(TESTS)
lab-programs: $(LAB)
bench-programs: $(BENCH)
# These programs contain all that they need but Windows' own libraries.
windows:
	@$(MAKE) --no-print-directory BUILD=$(BUILD)/windows OPENMP= \
	    CC=x86_64-w64-mingw32-gcc LDFLAGS='-static -s' \
	    $(addprefix $(BUILD)/windows/,libsaga.a saga-dec.exe saga-play.exe)
# Compiles every file of the tree without linking, but for those that have an
# object in the build folder COMPILED.
COMPILED =
objects: $(filter-out $(if $(COMPILED),$(patsubst $(COMPILED)/%,$(BUILD)/%, \
           $(shell find $(COMPILED)/obj -name '*.o'))),$(EVERY_OBJ))

$(LIB): $(COMMON_OBJ) $(DECODER_OBJ)
$(TRAIN): $(TRAINER_OBJ) $(ISA_OBJ)
$(TWICE): $(F64_OBJ)
$(PLAIN): $(call obj,$(PLAIN_TRAINER) tests/support/vectors.c)
$(REFERENCE): $(REFERENCE_OBJ)
$(HELPERS): $(HELPER_OBJ)
$(LIB) $(TRAIN) $(TWICE) $(PLAIN) $(REFERENCE) $(HELPERS): $(BUILD)/sources
	$(call say,AR)
	@rm -f $@
	$(AR) rcs $@ $(filter %.o,$^)

$(OBJ)/common/%.o: common/%.c $(BUILD)/flags
	$(call say,CC)
	@mkdir -p $(@D)
	$(call COMPILE,$(CORE) $(I_COMMON)) -c $< -o $@

$(OBJ)/decoder/%.o: decoder/%.c $(BUILD)/flags
	$(call say,CC)
	@mkdir -p $(@D)
	$(call COMPILE,$(CORE) $(I_DECODER)) -c $< -o $@

$(OBJ)/pic/%.o: %.c $(BUILD)/flags
	$(call say,CC)
	@mkdir -p $(@D)
	$(call COMPILE,$(CORE) -fPIC $(I_CORE)) -c $< -o $@

# The shared library exports only the functions that saga.h declares.
$(OBJ)/saga.map: $(SAGA_H)
	@mkdir -p $(@D)
	@echo '{ global:' >$@
	@sed -n 's/^[a-z].*[ *]\(saga_[a-z0-9_]*\)(.*/    \1;/p' $< >>$@
	@echo 'local: *; };' >>$@

$(SHARED): $(patsubst %.c,$(OBJ)/pic/%.o,$(COMMON_SRC) $(DECODER_SRC)) \
    $(OBJ)/saga.map $(BUILD)/sources
	$(call say,LINK)
	$(LINK) -shared -Wl,-soname,$(@F) -Wl,--version-script=$(OBJ)/saga.map \
	    $(filter %.o,$^) -o $@

$(OBJ)/trainer/%.o: trainer/%.c $(BUILD)/flags $(SAGA_H) $(REFERENCE_H)
	$(call say,CC)
	@mkdir -p $(@D)
	$(call COMPILE,$(HOST) $(OMP) $(I_ROOM) $(DOUBLE) $(ISA) $(QR_FLAG)) -c $< -o $@

define ISA_RULE
$(OBJ)/v$(1)/trainer/%.o: trainer/%.c $(BUILD)/flags $(SAGA_H)
	$$(call say,CC)
	@mkdir -p $$(@D)
	$$(call COMPILE,$$(HOST) $$(OMP) $$(I_ROOM) -DSAGA_ISA=$(1)) \
	    -march=x86-64-v$(1) -c $$< -o $$@
endef
$(foreach n,$(ISA_LEVELS),$(eval $(call ISA_RULE,$(n))))

$(OBJ)/f64/trainer/%.o: trainer/%.c $(BUILD)/flags $(SAGA_H)
	$(call say,CC)
	@mkdir -p $(@D)
	$(call COMPILE,$(HOST) $(OMP) $(I_ROOM) -DSAGA_REAL_DOUBLE) -c $< -o $@

$(OBJ)/tools/%.o: tools/%.c $(BUILD)/flags $(SAGA_H)
	$(call say,CC)
	@mkdir -p $(@D)
	$(call COMPILE,$(HOST) $(I_SAGA) -DSAGA_LEVEL=$(LEVEL)) -c $< -o $@

$(OBJ)/ports/windows/%.o: ports/windows/%.c $(BUILD)/flags
	$(call say,CC)
	@mkdir -p $(@D)
	$(call COMPILE,$(HOST) -Itools) -c $< -o $@

$(OBJ)/ports/windows/%.o: ports/windows/%.rc ports/windows/%.manifest
	$(call say,RC)
	@mkdir -p $(@D)
	$(MACHINE)-windres $< $@

$(OBJ)/reference/%.o: reference/%.c $(BUILD)/flags
	$(call say,CC)
	@mkdir -p $(@D)
	$(call COMPILE,$(HOST) $(I_REFERENCE)) -c $< -o $@

$(OBJ)/tests/%.o: tests/%.c $(BUILD)/flags
	$(call say,CC)
	@mkdir -p $(@D)
	$(call COMPILE,$(HOST) $(OMP) $(I_ALL) $(if $(filter %_f64.c,$<),\
	    -DSAGA_REAL_DOUBLE)) -c $< -o $@

$(OBJ)/lab/%.o: lab/%.c $(BUILD)/flags
	$(call say,CC)
	@mkdir -p $(@D)
	$(call COMPILE,$(HOST) $(OMP) $(I_ALL)) -c $< -o $@

$(OBJ)/bench/%.o: bench/%.c $(BUILD)/flags
	$(call say,CC)
	@mkdir -p $(@D)
	$(call COMPILE,$(HOST) $(OMP) $(I_ALL) -Ibench) -c $< -o $@

# The only header of the decoder that trainer and tools may include, and those
# of reference that the trainer's cli may include, are copied.
$(SAGA_H): decoder/saga.h
$(REFERENCE_H): $(BUILD)/include/%: reference/%
$(SAGA_H) $(REFERENCE_H):
	@mkdir -p $(@D)
	@cp $< $@

# The decoder for browsers is freestanding WebAssembly, in one build with SIMD
# and one without. The program saga contains the page, for `saga view`. Without
# clang and wasm-ld the decoder is not built.
WASM_CC = clang
WASM_LD = wasm-ld
# -flto inlines calls between files, which browsers do not.
WASM_FLAGS = --target=wasm32 -std=c11 -O3 -flto $(WARN) -ffreestanding \
             -mbulk-memory -MMD -MP
WASM_LDFLAGS = --no-entry --stack-first -z stack-size=65536 --strip-all
WASM_SRC := $(COMMON_SRC) $(DECODER_SRC) $(sort $(wildcard ports/web/*.c))
HAS_WASM := $(and $(shell command -v $(WASM_CC)),$(shell command -v $(WASM_LD)))
WEB = $(BUILD)/web
WEB_FILES := $(addprefix $(WEB)/,$(notdir $(sort $(wildcard \
    $(addprefix ports/web/*.,html css js)))) $(if $(HAS_WASM),saga.wasm \
    saga_simd.wasm whole.html))
# These files go into the packages of `npm pack` as well.
WEB_PACK := $(patsubst ports/web/%,$(WEB)/%,$(sort $(wildcard ports/web/*.ts \
    ports/web/*.json ports/web/*.md)))
# The packages for other engines use the package in build/web.
ENGINE_FILES := $(patsubst ports/%,$(BUILD)/%,$(sort $(wildcard \
    ports/three/* ports/playcanvas/*)))
web: $(WEB_FILES) $(WEB_PACK) $(ENGINE_FILES)

$(OBJ)/wasm/%.o: %.c $(BUILD)/flags $(SAGA_H)
	$(call say,WASM)
	@mkdir -p $(@D)
	$(WASM_CC) $(WASM_FLAGS) $(I_WASM) -c $< -o $@

$(OBJ)/wasm_simd/%.o: %.c $(BUILD)/flags $(SAGA_H)
	$(call say,WASM)
	@mkdir -p $(@D)
	$(WASM_CC) $(WASM_FLAGS) -msimd128 $(I_WASM) -c $< -o $@

$(WEB)/saga.wasm: $(WASM_SRC:%.c=$(OBJ)/wasm/%.o)
$(WEB)/saga_simd.wasm: $(WASM_SRC:%.c=$(OBJ)/wasm_simd/%.o)
$(WEB)/%.wasm: $(BUILD)/sources
	$(call say,LINK)
	@mkdir -p $(@D)
	$(WASM_LD) $(WASM_LDFLAGS) $(filter %.o,$^) -o $@

# The page in one file, into which `saga export` puts a film.
$(WEB)/whole.html: $(filter-out %/whole.html,$(WEB_FILES)) tools/whole.sh
	$(call say,LINK)
	tools/whole.sh $(WEB) >$@.part && mv $@.part $@

$(ENGINE_FILES): $(BUILD)/%: ports/%
	@mkdir -p $(@D)
	@cp $< $@

$(WEB)/%.js: ports/web/%.js tools/strip.sh
	@mkdir -p $(@D)
	@tools/strip.sh $< >$@

$(WEB)/index.html: ports/web/index.html tools/preload.sh \
    $(wildcard ports/web/*.js)
	@mkdir -p $(@D)
	@tools/preload.sh ports/web >$@.part && mv $@.part $@

$(WEB)/%: ports/web/%
	@mkdir -p $(@D)
	@cp $< $@

$(OBJ)/view_files.c: $(WEB_FILES) tools/embed.sh $(BUILD)/sources
	$(call say,EMBED)
	@mkdir -p $(@D)
	tools/embed.sh view $(WEB_FILES) >$@

$(OBJ)/report_files.c: trainer/cli/report.html tools/embed.sh
	$(call say,EMBED)
	@mkdir -p $(@D)
	tools/embed.sh report $< >$@

EMBEDDED = $(addprefix $(OBJ)/,view_files.o report_files.o)
$(EMBEDDED): $(OBJ)/%.o: $(OBJ)/%.c trainer/cli/view_files.h
	$(call say,CC)
	$(call COMPILE,$(HOST) -Itrainer/cli) -c $< -o $@

# These files are made again only if their contents change. Every object depends
# on `flags`, which has the compiler and its flags, every library on `sources`,
# which lists the source files, and what needs it on `qr`, which tells whether
# libqrencode is installed.
FLAGS   := $(CC) $(WARN) $(OPT) $(HOT_OPT) $(SAN_FLAGS) \
           $(OMP) $(CFLAGS) $(CORE_CFLAGS) $(LDFLAGS) $(strip $(LEVEL) $(SAN_LESS))
SOURCES := $(COMMON_SRC) $(DECODER_SRC) $(TRAINER_SRC) $(REFERENCE_SRC) \
           $(HELPER_SRC) $(WEB_FILES)
unless = $(if $(shell echo '$(2)' | cmp -s - $(1) && echo same),,FORCE)
$(BUILD)/flags: NOW = $(FLAGS)
$(BUILD)/flags: $(call unless,$(BUILD)/flags,$(FLAGS))
$(BUILD)/sources: NOW = $(SOURCES)
$(BUILD)/sources: $(call unless,$(BUILD)/sources,$(SOURCES))
$(BUILD)/qr: NOW = $(QR)
$(BUILD)/qr: $(call unless,$(BUILD)/qr,$(QR))
$(OBJ)/trainer/cli/view_code.o $(BUILD)/saga: $(BUILD)/qr
$(BUILD)/flags $(BUILD)/sources $(BUILD)/qr:
	@mkdir -p $(@D)
	@echo '$(NOW)' >$@
.PHONY: FORCE
FORCE:

# ---------------------------------------------------------------- programs

# The reference decoder consists of common/, decoder/ and code for files.
$(BUILD)/saga-dec$(EXE): $(OBJ)/tools/saga_dec.o $(DEC_OBJ) $(LIB)
	$(call say,LINK)
	$(LINK) $^ $(CLOCK) -o $@

# The example program of docs/threads.md.
$(BUILD)/saga-play$(EXE): $(OBJ)/tools/saga_play.o $(DEC_OBJ) $(LIB)
	$(call say,LINK)
	$(LINK) $^ -pthread -o $@

$(BUILD)/saga: $(CLI_OBJ) $(EMBEDDED) $(REFERENCE) $(TRAIN) $(LIB)
	$(call say,LINK)
	$(LINK) $(OMP) $(filter-out %/qr,$^) $(HOST_LIBS) -o $@

$(BUILD)/gen_tables: $(OBJ)/tools/gen_tables.o
	$(call say,LINK)
	$(LINK) $^ -lm -o $@

$(foreach t,$(TESTS_SRC:.c=),$(eval $(BUILD)/$(notdir $(t)): $(OBJ)/$(t).o))
# Only tests that take finite differences in double link the second objects.
$(filter %_f64,$(TESTS)): $(TWICE)
$(TESTS): $(HELPERS) $(REFERENCE) $(TRAIN) $(LIB)
	$(call say,LINK)
	$(LINK) $(LLD) $(OMP) $(filter %.o,$^) $(filter $(TWICE),$^) \
	    $(filter-out $(TWICE),$(filter %.a,$^)) $(WRAP_$(@F)) $(CMOCKA) \
	    $(HOST_LIBS) -o $@
# This program has a saga_crc32c of its own, which calls the library's.
WRAP_test_read_once = -Wl,--wrap=saga_crc32c

$(BUILD)/bench_numerics: $(OBJ)/bench/bench_numerics.o
$(BUILD)/bench_table: $(BENCH_OBJ)
$(BENCH): $(HELPERS) $(REFERENCE) $(TRAIN) $(LIB)
	$(call say,LINK)
	$(LINK) $(LLD) $(OMP) $(filter %.o,$^) $(filter %.a,$^) $(HOST_LIBS) -o $@

$(LAB): $(BUILD)/%: $(OBJ)/lab/%.o $(HELPERS) $(REFERENCE) $(TRAIN) $(LIB)
	$(call say,LINK)
	$(LINK) $(LLD) $(OMP) $^ $(HOST_LIBS) -o $@

# check_vectors is built for every target of tests/run_matrix.sh, so that it
# links no libraries except libc and libm.
$(BUILD)/check_vectors$(EXE): $(OBJ)/tests/stream/check_vectors.o \
    $(OBJ)/tests/stream/check_init.o $(OBJ)/reference/ref_recorder.o \
    $(WINDOWS_OBJ) $(PLAIN) $(LIB)
	$(call say,LINK)
	$(LINK) $^ -lm -o $@

# Fuzzers, for libFuzzer; tests/run_fuzz.sh builds them.
FUZZ := $(addprefix $(BUILD)/,$(notdir $(patsubst %.c,%,$(wildcard \
          tests/*/fuzz_*.c))))
$(BUILD)/fuzz_decode: $(OBJ)/tests/stream/fuzz_decode.o
$(BUILD)/fuzz_segment: $(OBJ)/tests/stream/fuzz_segment.o
$(BUILD)/fuzz_input: $(OBJ)/tests/capture/fuzz_input.o
$(BUILD)/fuzz_http: $(OBJ)/tests/cli/fuzz_http.o
$(BUILD)/fuzz_path: $(OBJ)/tests/cli/fuzz_path.o $(addprefix \
    $(OBJ)/trainer/cli/,render_path.o render_colmap.o)
$(FUZZ): $(HELPERS) $(REFERENCE) $(TRAIN) $(LIB)
	$(call say,LINK)
	$(LINK) $(OMP) -fsanitize=fuzzer $(filter %.o,$^) $(filter %.a,$^) \
	    $(HOST_LIBS) -o $@

# ---------------------------------------------------------------- install

# Manual pages and completions are made from the programs' --help.
PAGES = $(BUILD)/pages
PAGE_FILES := $(foreach p,saga saga-dec saga-play,$(foreach f,man bash zsh fish,\
                $(PAGES)/$(p).$(f)))
$(PAGE_FILES): $(addprefix $(BUILD)/,saga saga-dec saga-play) \
    tools/help_pages.sh
	$(call say,PAGE)
	@mkdir -p $(@D)
	@tools/help_pages.sh $(subst .,,$(suffix $@)) \
	    $(BUILD)/$(basename $(@F)) >$@

.PHONY: pages install uninstall
pages: $(PAGE_FILES)
PLACE   = BINDIR='$(BINDIR)' LIBDIR='$(LIBDIR)' INCLUDEDIR='$(INCLUDEDIR)' \
          DATADIR='$(DATADIR)' PYTHONDIR='$(PYTHONDIR)' DESTDIR='$(DESTDIR)' \
          tools/install.sh
install: all shared pages
	@$(PLACE) put $(BUILD)
uninstall:
	@$(PLACE) remove $(BUILD)

# The archives for a release are made in build/dist: a wheel, packages for npm,
# the source, and the checksums of all. The same commit gives the same bytes.
DIST = $(BUILD)/dist
NPM := $(addprefix $(BUILD)/,web three playcanvas)
RELEASE := $(shell sed -n 's/^.define SAGA_RELEASE "\(.*\)"/\1/p' decoder/saga.h)
.PHONY: wheel npm dist
wheel: $(SHARED)
	@tools/wheel.py $< $(DIST)

npm: web $(addsuffix /LICENSE,$(NPM))
	@test -n '$(HAS_WASM)' || \
	    { echo 'make npm needs clang and wasm-ld (Debian: clang lld)'; exit 1; }
	@mkdir -p $(DIST)
	@npm pack --offline --silent --pack-destination $(DIST) $(NPM:%=./%)

$(addsuffix /LICENSE,$(NPM)): LICENSE
	@mkdir -p $(@D)
	@cp $< $@

dist:
	@rm -rf $(DIST)
	@$(MAKE) --no-print-directory wheel npm
	@git archive --prefix=saga-$(RELEASE)/ HEAD | gzip -n \
	    >$(DIST)/saga-$(RELEASE).tar.gz
	@cd $(DIST) && sha256sum *.whl *.tgz *.tar.gz >SHA256SUMS && cat SHA256SUMS

# The libraries that the programs load, with versions and licences (CycloneDX).
.PHONY: sbom
sbom: $(BUILD)/saga $(BUILD)/saga-dec $(BUILD)/saga-play
	@mkdir -p $(DIST)
	@tools/sbom.py $^ >$(DIST)/saga.cdx.json

# The package for implementers of other decoders.
.PHONY: conformance
CONFORMANCE = saga-conformance-$(RELEASE)
conformance:
	@mkdir -p $(DIST)
	@git archive --prefix=$(CONFORMANCE)/ HEAD LICENSE vectors \
	    $(addprefix docs/,bitstream.md arithmetic.md bitstream.ksy \
	    decoder-in-a-day.md levels.md) | gzip -n >$(DIST)/$(CONFORMANCE).tar.gz

# ---------------------------------------------------------------- tests

# run-tests runs every test program, in parallel with -j, and continues after a
# failure. A program's output goes to $(BUILD)/log/NAME.log, its exit status to
# NAME.rc, and the output of the shell's `times` to NAME.cpu.
TIMEOUT = 1200
.PHONY: run-tests
run-tests: $(TESTS:$(BUILD)/%=$(BUILD)/log/%.log)
$(BUILD)/log/%.log: $(BUILD)/% FORCE
	@mkdir -p $(@D)
	@s=0; timeout $(TIMEOUT) $< >$@ 2>&1 </dev/null || s=$$?; \
	    echo $$s >$(@:.log=.rc); \
	    times >$(@:.log=.cpu)

.PHONY: check test test-all setup setup-test setup-packages sanitize lint \
        symbols nofloat stack headers tree format circles docs tables kernels matrix init mutants coverage prove fuzz bench \
        vectors clean
setup:
	@tests/setup.sh build
setup-test setup-packages: setup-%:
	@tests/setup.sh $*

# tests/README.md lists the tests that each of these targets runs.
check:
	@tests/setup.sh check
	@tests/run_tests.sh $@

test:
	@tests/setup.sh test
	@tests/run_tests.sh $@

test-all:
	@tests/setup.sh all
	@tests/run_tests.sh all

sanitize:
	@tests/run_tests.sh sanitize

# This file tells editors and linters how each source file is compiled.
COMMANDS = compile_commands.json
$(COMMANDS): $(SAGA_H) $(REFERENCE_H) FORCE
	@$(MAKE) --no-print-directory -Bn objects | awk -v dir='$(CURDIR)' ' \
	    / -c / && !/\/(f64|v3|v4)\// { \
	        file = $$0; sub(/.* -c /, "", file); sub(/ .*/, "", file); \
	        gsub(/["\\]/, "\\\\&"); \
	        printf "%s{ \"directory\": \"%s\", \"file\": \"%s\",\n" \
	            "\"command\": \"%s\" }", n++ ? ",\n" : "[\n", dir, file, $$0 \
	    } END { print "\n]" }' >$@

lint:
	@tests/setup.sh lint
	@tests/check_lint.sh

symbols:
	@tests/check_symbols.sh
nofloat:
	@tests/check_nofloat.sh
stack:
	@tests/check_stack.py
headers:
	@tests/check_headers.sh
tree:
	@tests/check_tree.sh
format:
	@tests/check_format.sh --fix
circles: $(COMMON_OBJ) $(DECODER_OBJ) $(TRAINER_OBJ) $(CLI_OBJ) $(REFERENCE_OBJ)
	@tests/check_circles.sh $(BUILD)
docs:
	@tests/check_docs.sh
# The tables of common/ must be those that tools/gen_tables.c prints.
tables: $(BUILD)/gen_tables
	@for t in fx prob; do \
	    if $< $$t | cmp - common/$${t}_tables.h; then \
	        echo "ok   tables $$t"; \
	    else \
	        echo "FAIL tables $$t: not what gen_tables $$t prints"; bad=1; \
	    fi; \
	done; test -z "$$bad"
# The kernels of the GPU are committed in SPIR-V, so that a build needs no
# compiler of shaders.
kernels:
	@tests/setup.sh check
	@tools/kernels.sh >$(BUILD)/kernels.c
	@mv $(BUILD)/kernels.c trainer/gpu/kernels.c
matrix:
	@tests/run_matrix.sh small
init:
	@tests/check_init.sh small
mutants:
	@tests/run_mutants.sh
coverage:
	@tests/check_coverage.py
prove:
	@tests/setup.sh prove
	@tests/run_prove.py
# Minutes for each fuzzer.
MINUTES = 5
fuzz:
	@tests/run_fuzz.sh $(MINUTES) $(ARGS)

# bench/before.json is an earlier result for comparison. ARGS selects parts, as
# in bench/bench_table.c.
bench:
	@+$(MAKE) --no-print-directory BUILD=$(BUILD)/bench \
	    OPT='-O3 -march=native' $(BUILD)/bench/bench_table
	@$(BUILD)/bench/bench_table -o $(BUILD)/bench/bench.json \
	    -b bench/before.json $(ARGS)

# Makes the demo of the README: the built-in scene is rendered, encoded, decoded
# and evaluated.
THREADS = 2
.PHONY: demo
demo: setup
	@$(MAKE) --no-print-directory $(BUILD)/saga
	@tools/demo.sh $(BUILD)/saga $(BUILD)/demo $(THREADS)

# Prints a table that compares the demo's file with simple alternatives, one of
# which needs a further training (lab/floors.sh).
.PHONY: floors
floors: setup
	@$(MAKE) --no-print-directory $(BUILD)/saga $(BUILD)/make_zeroed
	@test -s $(BUILD)/demo/encode.json || \
	    $(MAKE) --no-print-directory demo
	@lab/floors.sh $(BUILD)/saga $(BUILD)/demo $(THREADS)

# Measures how many bytes each part of the entropy model saves, for the built-in
# scene at four rates, and shared anchors for two scenes, and writes
# docs/results/ablation.md and .svg with these and the paper's numbers. SCENES
# has further files for the comparison with an order-0 coder, as NAME=FILE.saga.
SCENES =
.PHONY: ablation
ablation:
	@tests/setup.sh plot
	@$(MAKE) --no-print-directory $(BUILD)/saga $(LAB)
	@lab/ablation.sh $(BUILD)/saga $(BUILD)/ablation docs/results \
	    $(THREADS) $(SCENES)

# Compares the rate and distortion of files with other codecs, for every scene
# of lab/rd.ini at four rates with several seeds, and writes docs/results/rd.md
# and .svg. This takes hours of CPU time; each result is kept as a row in
# docs/results/rd. CAPTURES has the captures that are not built in, as
# NAME=PATH. ARGS selects scenes, rates and seeds, as in lab/rd.py.
CAPTURES = studio=../shared/data/studio person4=../shared/data/person4
RD = SAGA=$(BUILD)/saga WORK=$(BUILD)/rd THREADS=$(THREADS) lab/rd.py
.PHONY: rd rd-short
rd:
	@tests/setup.sh plot
	@$(MAKE) --no-print-directory $(BUILD)/saga
	@$(RD) --x265 $(ARGS) $(CAPTURES) && $(RD) $(ARGS) $(CAPTURES)

rd-short: setup
	@$(MAKE) --no-print-directory $(BUILD)/saga
	@$(RD) --short $(ARGS)

# Compares FILES, which were encoded from the capture CAPTURE, with the video
# codecs that ffmpeg supports. Without FILES, saga is trained at four rates,
# which takes long. Writes curves, BD-rates and a page to build/compare/NAME,
# where NAME is the name of the capture.
CAPTURE =
FILES =
.PHONY: compare
compare: setup
	@test -n '$(CAPTURE)' || \
	    { echo 'make compare CAPTURE=FOLDER [FILES="A.saga ..."]'; exit 1; }
	@$(MAKE) --no-print-directory $(BUILD)/saga
	@SAGA=$(BUILD)/saga THREADS=$(THREADS) lab/compare.py '$(CAPTURE)' \
	    '$(BUILD)/compare/$(notdir $(CAPTURE:/=))' $(FILES)

# Measures the time and the error of every operator of the decoder, in integers
# with and without vector instructions and in float, and the errors of other
# number formats. Writes docs/results/numerics.md, .json and plots. SCENES has
# files that are verified in addition to the demo.
NUMERICS = $(MAKE) --no-print-directory OPT=-O3 CFLAGS=-march=x86-64-v3
.PHONY: numerics
numerics:
	@tests/setup.sh plot
	@$(MAKE) --no-print-directory $(BUILD)/saga $(BUILD)/make_formats
	@$(NUMERICS) BUILD=$(BUILD)/numerics $(BUILD)/numerics/bench_numerics
	@$(NUMERICS) BUILD=$(BUILD)/numerics-plain \
	    CORE_CFLAGS=-mgeneral-regs-only $(BUILD)/numerics-plain/bench_numerics
	@lab/numerics.py $(BUILD) docs/results demo=docs/demo.saga $(SCENES)

# Writes the vectors again that are made from a seed or by edits, and prints the
# lines that a new one needs in MANIFEST and PICTURES. No other file may change.
$(BUILD)/make_vectors $(BUILD)/make_worst: $(BUILD)/%: \
    $(OBJ)/tests/stream/%.o $(HELPERS) $(REFERENCE) $(TRAIN) $(LIB)
	$(call say,LINK)
	$(LINK) $(OMP) $^ $(HOST_LIBS) -o $@
vectors: $(BUILD)/make_vectors $(BUILD)/check_vectors
	$(BUILD)/make_vectors vectors <tests/stream/streams.txt \
	    >$(BUILD)/streams.lines
	! grep -vxF -f vectors/MANIFEST -f vectors/PICTURES \
	    $(BUILD)/streams.lines
	tests/stream/make_refusals.py vectors
	SAGA_CHECK_VECTORS=$(BUILD)/check_vectors tests/check_frozen.py

# Writes the container's description for Kaitai Struct, from bitstream.md.
.PHONY: ksy
ksy:
	tests/stream/make_ksy.py >docs/bitstream.ksy

clean:
	rm -rf $(BUILD)

define HELP
Build
make [all]       $(BUILD)/libsaga.a, saga-dec (the decoder), saga (the encoder)
make shared      $(SHARED), the decoder for programs and for Python
make windows     libsaga.a, saga-dec.exe and saga-play.exe, cross-compiled by
                 MinGW-w64, in $(BUILD)/windows
make web         the page and the decoder for browsers, in $(BUILD)/web
make wheel       the Python module with its library, in $(BUILD)/dist
make npm         the packages for browsers and engines, in $(BUILD)/dist
make dist        wheel, npm packages, source and checksums; needs a git clone
make sbom        what the programs load, as CycloneDX: build/dist/saga.cdx.json
make conformance documents, vectors and a program that compares, for authors of
                 other decoders, in $(BUILD)/dist
make setup       installs the packages that a build needs (Debian, as root);
                 setup-test: also what make test needs; setup-packages: what
                 makes packages for Debian. Targets that need more say what is
                 missing, and install it
make install     programs, library, header, manual pages, completion; PREFIX=
                 /usr/local, DESTDIR=, BINDIR, LIBDIR, INCLUDEDIR, DATADIR
make uninstall   removes what make install has installed
make clean       removes $(BUILD)

Try and measure
make demo        encodes, decodes and judges the built-in scene: 3 CPU minutes
make compare     codes CAPTURE= with x265, SVT-AV1, libaom and VVenC, as far as
                 ffmpeg has them, and compares with the .saga files in FILES=
make floors      compares the demo with simpler ways to code: 4 CPU minutes
make ablation    measures each part of the entropy model: 50 CPU minutes
make rd          rate-distortion curves of all scenes and codecs: hours
make rd-short    the same for two small scenes at one rate, against the last
make numerics    cost and exactness of each operator: 1 CPU minute
make bench       time of each operator, against the limits of this machine

Test
make check       unit tests, vectors, a tiny encode: less than 1 CPU minute
make test        what CI runs, with sanitizers: 10 CPU minutes
make test-all    all tests in all builds and on all emulated targets: hours
make sanitize    the test programs under ASan and UBSan
make lint        clang-tidy, with the exceptions in .clang-tidy
make symbols     undefined symbols, prefixes, .data and .bss of the decoder
make nofloat     no floating point in common/ and decoder/
make stack       worst-case stack of every public function
make headers     every header compiles alone
make tree        allowed includes, file names, licence lines, columns
make format      writes all C as .clang-format says
make circles     no two object files need each other
make docs        links, columns and wording of the pages
make tables      the generated tables are what gen_tables prints
make matrix      the vectors with every compiler and emulated target
make init        no output depends on uninitialised memory
make mutants     planted mistakes are found by the tests
make coverage    the vectors reach the extremes that vectors/COVERAGE lists
make prove       no overflow and no access outside, by Frama-C: 2 CPU minutes
make fuzz        libFuzzer on decoder, readers, paths, server, MINUTES=5 each

Generate
make vectors     writes vectors/good and REFUSALS again
make ksy         writes docs/bitstream.ksy from the tables of bitstream.md
make kernels     compiles trainer/gpu/kernels/*.comp to trainer/gpu/kernels.c
make compile_commands.json   how each file is compiled, for editors

CC=gcc|clang|...   OPT=-O2   HOT_OPT=-O3 (inner loops)   CFLAGS= LDFLAGS=
WERROR=-Werror   SANITIZE=1   LEVEL=2 (memory of saga-dec)   BUILD=build   V=1
THREADS=2 (demo, floors, ablation, rd)   CAPTURES='NAME=PATH ...' (rd)
SCENES='NAME=FILE.saga ...' (ablation, numerics)
Random tests: SAGA_TEST_SEED, SAGA_TEST_COUNT, SAGA_TEST_LONG=1 (environment)
endef
export HELP
help:
	@echo "$$HELP"

-include $(shell find $(OBJ) -name '*.d' 2>/dev/null)
