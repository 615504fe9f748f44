# SPDX-License-Identifier: MIT
#
# saga. `make help` lists the targets and the variables.
#
# Include law (docs/architecture.md), enforced by the -I of each folder:
#   common   sees common
#   decoder  sees common, decoder
#   trainer  sees common and saga.h alone (build/include), and each of its rooms
#            what SEE_room says below
#   tools    see saga.h alone
#   tests, lab, bench  see everything
#
# Everything is built under BUILD. A change of compiler or flags rebuilds;
# configurations that live side by side take different BUILD folders:
#   make BUILD=build/clang CC=clang OPT=-O3

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
WERROR =# -Werror in the tests
CFLAGS =# added to every compilation, after ours
LDFLAGS =# added to every link, before the objects
SANITIZE =# 1: ASan and UBSan, and the domain checks of fx.h
ARGS =# of a program run by `make bench`

HOT = common/mlp common/fx_math common/memory_bank decoder/raster \
      decoder/project

# Parts of the trainer without dependencies: check_vectors may use them and the
# tests' helpers, so that it can be built for every target with libc and libm.
PLAIN_TRAINER = $(addprefix trainer/code/,cost.c range_enc.c look_up.c \
                  encode.c vectors.c) $(addprefix trainer/base/,alloc.c error.c)

# The rooms of the trainer, from the ground up, and what each may see.
ROOMS := base nn input code splat synth rig scene entropy warm train eval cli
SEE_base    :=
SEE_nn      := base
SEE_input   := base
SEE_code    := base
SEE_splat   := base
SEE_synth   := base input
SEE_rig     := base input splat
SEE_scene   := base nn code splat
SEE_entropy := base nn code splat scene
SEE_warm    := base nn input splat rig
SEE_train   := base nn input code splat rig scene entropy warm
SEE_eval    := base input rig
SEE_cli     := base nn input code splat synth rig scene entropy warm train eval

# ---------------------------------------------------------------- sources

COMMON_SRC  := $(sort $(wildcard common/*.c))
DECODER_SRC := $(sort $(wildcard decoder/*.c decoder/*/*.c))
TRAINER_SRC := $(sort $(wildcard trainer/*/*.c))
CLI_SRC     := $(filter trainer/cli/%,$(TRAINER_SRC))
TESTS_SRC   := $(sort $(wildcard tests/*/test_*.c))
HELPER_SRC  := $(sort $(wildcard tests/support/*.c lab/gen_*.c))
BENCH_SRC   := $(sort $(wildcard bench/bench_*.c))

OBJ = $(BUILD)/obj
obj = $(patsubst %.c,$(OBJ)/%.o,$(1))
COMMON_OBJ  := $(call obj,$(COMMON_SRC))
DECODER_OBJ := $(call obj,$(DECODER_SRC))
TRAINER_OBJ := $(call obj,$(filter-out $(CLI_SRC),$(TRAINER_SRC)))
CLI_OBJ     := $(call obj,$(CLI_SRC))

# The float half. Its operators compile a second time in double, for finite
# differences and references: objects under f64, symbols ending in _f64.
FLOAT_SRC := $(sort $(foreach r,base nn splat rig scene entropy warm train,\
                 $(wildcard trainer/$(r)/*.c)))
TWICE_SRC := $(filter-out $(addprefix trainer/,scene/hierarchy.c scene/tree.c \
               scene/budget.c scene/medoid.c entropy/rate_bits.c \
               entropy/rate_choice.c),$(filter trainer/nn/% \
               trainer/splat/% trainer/scene/% trainer/entropy/%,$(FLOAT_SRC)))
F64_OBJ   := $(TWICE_SRC:%.c=$(OBJ)/f64/%.o)
HELPER_OBJ  := $(call obj,$(HELPER_SRC))

LIB     = $(BUILD)/libsaga.a
TRAIN   = $(BUILD)/libtrainer.a
PLAIN   = $(BUILD)/libplain.a
HELPERS = $(BUILD)/libhelpers.a
SAGA_H  = $(BUILD)/include/saga.h

TOOLS := $(if $(wildcard tools/saga_dec.c),$(BUILD)/saga-dec) \
         $(if $(CLI_SRC),$(BUILD)/saga) \
         $(if $(wildcard tools/gen_tables.c),$(BUILD)/gen_tables)
TESTS := $(addprefix $(BUILD)/,$(notdir $(TESTS_SRC:.c=)))
# What scripts in lab/ take files apart with: coarse features zeroed, entropy
# networks fitted anew, the order-0 coder's bytes, times of the layers.
FILE_TOOLS := $(addprefix $(BUILD)/,make_zeroed make_order0 make_refit \
                make_times)
BENCH := $(BENCH_SRC:bench/%.c=$(BUILD)/%)

# ---------------------------------------------------------------- flags

WARN = -Wall -Wextra -Wconversion -Wshadow -Wundef -Wcast-align \
       -Wstrict-prototypes -Wmissing-prototypes -Wvla $(WERROR)
SAN_ALL   = -g -fsanitize=address -fsanitize=undefined \
            -fno-sanitize-recover=all -fno-omit-frame-pointer
SAN_FLAGS = $(if $(SANITIZE),$(SAN_ALL))
SAN_DEFS  = $(if $(SANITIZE),-DSAGA_CHECK)
BASE = -std=c11 $(WARN) $(SAN_DEFS) -MMD -MP

# The norm: freestanding integers. The folder of the object says what it sees.
CORE = $(BASE) -ffreestanding
# Hosted code: POSIX names; floats are never contracted nor reassociated.
HOST = $(BASE) -D_XOPEN_SOURCE=700 -ffp-contract=off

# OpenMP where the compiler can link it (Debian's clang cannot without libomp;
# the trainer's results do not depend on the number of threads).
OPENMP = $(shell printf 'int main(void){return 0;}' | $(CC) -fopenmp -x c \
           - -o /dev/null 2>/dev/null && echo -fopenmp)
ifneq ($(CLI_SRC)$(TRAINER_SRC),)
OPENMP_FLAG := $(OPENMP)
endif
OMP = $(if $(OPENMP_FLAG),$(OPENMP_FLAG),-Wno-unknown-pragmas)

comma := ,
AS_NEEDED = $(if $(filter Darwin,$(shell uname -s)),,-Wl$(comma)--as-needed)
HOST_LIBS = $(AS_NEEDED) -lOpenEXRCore $(shell pkg-config --libs jansson \
              libpng zlib 2>/dev/null || echo -ljansson -lpng -lz) -lm
# System headers: their warnings are not ours.
EXR_INC   = $(patsubst -I%,-isystem %,$(shell pkg-config --cflags-only-I \
              OpenEXR 2>/dev/null))
CMOCKA    = $(AS_NEEDED) -lcmocka

COMPILE = $(CC) $(1) $(OPT_LEVEL) $(SAN_FLAGS) $(CFLAGS)
LINK    = $(CC) $(OPT) $(SAN_FLAGS) $(CFLAGS) $(LDFLAGS)

OPT_LEVEL = $(OPT)
$(foreach f,$(HOT),$(OBJ)/$(f).o): OPT_LEVEL = $(HOT_OPT)
# Where this machine has AVX2 and the compiler is its own, the float half uses
# it (trainer/base/vec.h).
MARCH := $(if $(shell grep -m1 -o avx2 /proc/cpuinfo 2>/dev/null),$(if \
           $(filter x86_64%,$(shell $(CC) $(CFLAGS) -dumpmachine)),\
           -march=x86-64-v3))
$(FLOAT_SRC:%.c=$(OBJ)/%.o) $(F64_OBJ): OPT_LEVEL = $(HOT_OPT) $(MARCH)

I_COMMON  = -Icommon -Icommon/arch
I_DECODER = -Icommon -Idecoder
I_SAGA    = -I$(BUILD)/include
# Of the room that the file in $* lies in.
I_ROOM    = -Icommon $(I_SAGA) $(foreach r,$(firstword $(subst /, ,$*)),\
              $(patsubst %,-Itrainer/%,$(r) $(SEE_$(r)))) $(EXR_INC)
I_ALL     = $(I_COMMON) -Idecoder $(ROOMS:%=-Itrainer/%) -Itests/support -Ilab

# ---------------------------------------------------------------- build

.PHONY: all lib tests bench-programs help
all: lib $(TOOLS)
lib: $(LIB)
tests: $(TESTS) $(FILE_TOOLS)
bench-programs: $(BENCH)

$(LIB): $(COMMON_OBJ) $(DECODER_OBJ)
$(TRAIN): $(TRAINER_OBJ) $(F64_OBJ)
$(PLAIN): $(call obj,$(PLAIN_TRAINER))
$(HELPERS): $(HELPER_OBJ)
$(LIB) $(TRAIN) $(PLAIN) $(HELPERS):
	@mkdir -p $(@D)
	@rm -f $@
	$(AR) rcs $@ $^

$(OBJ)/common/%.o: common/%.c $(BUILD)/flags
	@mkdir -p $(@D)
	$(call COMPILE,$(CORE) $(I_COMMON)) -c $< -o $@

$(OBJ)/decoder/%.o: decoder/%.c $(BUILD)/flags
	@mkdir -p $(@D)
	$(call COMPILE,$(CORE) $(I_DECODER)) -c $< -o $@

$(OBJ)/trainer/%.o: trainer/%.c $(BUILD)/flags $(SAGA_H)
	@mkdir -p $(@D)
	$(call COMPILE,$(HOST) $(OMP) $(I_ROOM)) -c $< -o $@

$(OBJ)/f64/trainer/%.o: trainer/%.c $(BUILD)/flags $(SAGA_H)
	@mkdir -p $(@D)
	$(call COMPILE,$(HOST) $(OMP) $(I_ROOM) -DSAGA_REAL_DOUBLE) -c $< -o $@

$(OBJ)/tools/%.o: tools/%.c $(BUILD)/flags $(SAGA_H)
	@mkdir -p $(@D)
	$(call COMPILE,$(HOST) $(I_SAGA) -DSAGA_LEVEL=$(LEVEL)) -c $< -o $@

$(OBJ)/tests/%.o: tests/%.c $(BUILD)/flags
	@mkdir -p $(@D)
	$(call COMPILE,$(HOST) $(OMP) $(I_ALL) $(if $(filter %_f64.c,$<),\
	    -DSAGA_REAL_DOUBLE)) -c $< -o $@

$(OBJ)/lab/%.o: lab/%.c $(BUILD)/flags
	@mkdir -p $(@D)
	$(call COMPILE,$(HOST) $(OMP) $(I_ALL)) -c $< -o $@

$(OBJ)/bench/%.o: bench/%.c $(BUILD)/flags
	@mkdir -p $(@D)
	$(call COMPILE,$(HOST) $(OMP) $(I_ALL) -Ibench) -c $< -o $@

# saga.h alone, for those who may see nothing else of the decoder.
$(SAGA_H): decoder/saga.h
	@mkdir -p $(@D)
	@cp $< $@

# Rewritten only when the compiler or a flag changes.
FLAGS_NOW = $(CC) $(WARN) $(OPT) $(HOT_OPT) $(SAN_FLAGS) $(OMP) $(CFLAGS) \
            $(LDFLAGS) $(LEVEL)
$(BUILD)/flags: FORCE
	@mkdir -p $(@D)
	@echo '$(FLAGS_NOW)' | cmp -s - $@ || echo '$(FLAGS_NOW)' > $@
.PHONY: FORCE
FORCE:

# ---------------------------------------------------------------- programs

# The reference decoder: common/ and decoder/ plus reading and writing files.
$(BUILD)/saga-dec: $(OBJ)/tools/saga_dec.o $(LIB)
	$(LINK) $^ -o $@

$(BUILD)/saga: $(CLI_OBJ) $(TRAIN) $(LIB)
	$(LINK) $(OMP) $^ $(HOST_LIBS) -o $@

$(BUILD)/gen_tables: $(OBJ)/tools/gen_tables.o
	$(LINK) $^ -lm -o $@

$(foreach t,$(TESTS_SRC:.c=),$(eval $(BUILD)/$(notdir $(t)): $(OBJ)/$(t).o))
$(TESTS): $(HELPERS) $(TRAIN) $(LIB)
	$(LINK) $(OMP) $(filter %.o,$^) $(filter %.a,$^) $(CMOCKA) $(HOST_LIBS) -o $@

$(BENCH): $(BUILD)/%: $(OBJ)/bench/%.o $(HELPERS) $(TRAIN) $(LIB)
	$(LINK) $(OMP) $^ $(HOST_LIBS) -o $@

$(FILE_TOOLS): $(BUILD)/%: $(OBJ)/lab/%.o $(HELPERS) $(TRAIN) $(LIB)
	$(LINK) $(OMP) $^ $(HOST_LIBS) -o $@

# No library but libc and libm: for every target of tests/run_matrix.sh.
$(BUILD)/check_vectors: $(OBJ)/tests/stream/check_vectors.o $(HELPERS) $(PLAIN) $(LIB)
	$(LINK) $^ -lm -o $@

# ---------------------------------------------------------------- tests

# Runs every test program, in parallel with -j and past failures: the output
# goes to $(BUILD)/log/NAME.log, the exit status to NAME.rc.
TIMEOUT = 1200
.PHONY: run-tests
run-tests: $(TESTS:$(BUILD)/%=$(BUILD)/log/%.log)
$(BUILD)/log/%.log: $(BUILD)/% FORCE
	@mkdir -p $(@D)
	@s=0; timeout $(TIMEOUT) $< >$@ 2>&1 </dev/null || s=$$?; \
	    echo $$s >$(@:.log=.rc); \
	    times >$(@:.log=.cpu)

.PHONY: test check test-all setup sanitize symbols nofloat stack headers \
        tree tables matrix mutants bench vectors clean
setup:
	@tests/setup.sh

test check: setup
	@tests/run_tests.sh small

test-all:
	@tests/setup.sh all
	@tests/run_tests.sh all

sanitize:
	@tests/run_tests.sh sanitize

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
# common/*_tables.h are what tools/gen_tables.c prints.
tables: $(BUILD)/gen_tables
	@for t in fx prob; do \
	    if $< $$t | cmp - common/$${t}_tables.h; then \
	        echo "ok   tables $$t"; \
	    else \
	        echo "FAIL tables $$t: not what gen_tables $$t prints"; bad=1; \
	    fi; \
	done; test -z "$$bad"
matrix:
	@tests/run_matrix.sh small
mutants:
	@tests/run_mutants.sh small

bench:
	@+$(MAKE) --no-print-directory BUILD=$(BUILD)/bench \
	    OPT='-O3 -march=native' bench-programs
	@for b in $(BENCH_SRC:bench/%.c=%); do \
	    echo "== $$b"; $(BUILD)/bench/$$b $(ARGS) || exit 1; done

# The built-in scene through synth, encode and eval: what README shows.
THREADS = 2
.PHONY: demo
demo: setup
	@$(MAKE) --no-print-directory $(BUILD)/saga
	@tools/demo.sh $(BUILD)/saga $(BUILD)/demo $(THREADS)

# What the demo's file is worth beside what needs no such codec: another
# training, and a table of goals and numbers.
.PHONY: floors
floors: setup
	@$(MAKE) --no-print-directory $(BUILD)/saga $(BUILD)/make_zeroed
	@test -s $(BUILD)/demo/encode.json || \
	    $(MAKE) --no-print-directory demo
	@lab/floors.sh $(BUILD)/saga $(BUILD)/demo $(THREADS)

# What the parts of the entropy model are worth, on the built-in scene at four
# rates: docs/results/ablation.md and .svg, which it writes anew. SCENES: more
# files for the comparison with an order-0 coder, NAME=FILE.saga each.
SCENES =
.PHONY: ablation
ablation:
	@tests/setup.sh plot
	@$(MAKE) --no-print-directory $(BUILD)/saga $(FILE_TOOLS)
	@lab/ablation.sh $(BUILD)/saga $(BUILD)/ablation docs/results \
	    $(THREADS) $(SCENES)

# Regenerates vectors/ and its MANIFEST. Look at the difference before
# committing it: only a change of the format may change a vector.
$(BUILD)/make_vectors: $(OBJ)/tests/stream/make_vectors.o $(HELPERS) $(TRAIN) \
    $(LIB)
	$(LINK) $(OMP) $^ $(HOST_LIBS) -o $@
vectors: $(BUILD)/make_vectors
	$(BUILD)/make_vectors vectors

clean:
	rm -rf $(BUILD)

define HELP
make [all]       $(BUILD)/libsaga.a, saga-dec (decoder), saga (trainer), gen_tables
make demo        the built-in scene, encoded, decoded and judged; 10 CPU minutes
make floors      the demo beside what needs no such codec; 10 CPU minutes more
make ablation    what the entropy model's parts are worth; about 50 CPU minutes
make setup       installs what is missing to build and test (Debian, as root)
make test        installs what is missing (Debian), then all; 16-20 CPU minutes
make test-all    the same with every emulated target and the long counts
make sanitize    the test programs under ASan and UBSan alone
make symbols     undefined symbols, prefixes, .data and .bss of the decoder
make nofloat     no floating point in common/ and decoder/
make stack       worst-case stack of every public function
make headers     every header compiles alone
make tree        include law, file names, licence lines, columns
make tables      the generated tables are what gen_tables prints
make matrix      the vectors on every compiler and emulated target
make mutants     planted mistakes that the gates must catch
make bench       builds and runs bench/ with -O3 -march=native; ARGS=...
make vectors     regenerates vectors/
make clean       removes $(BUILD)

CC=gcc|clang|...   OPT=-O2   HOT_OPT=-O3 (inner loops)   CFLAGS= LDFLAGS=
WERROR=-Werror   SANITIZE=1   LEVEL=2 (memory of saga-dec)   BUILD=build
THREADS=2 (demo, floors, ablation)   SCENES='NAME=FILE.saga ...' (ablation)
SAGA_TEST_SEED, SAGA_TEST_COUNT, SAGA_TEST_LONG=1 (environment): random tests
endef
export HELP
help:
	@echo "$$HELP"

-include $(shell find $(OBJ) -name '*.d' 2>/dev/null)
