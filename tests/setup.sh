#!/bin/sh
# SPDX-License-Identifier: MIT
#
# setup.sh [FOR]: says which Debian packages are missing for a purpose, and
# installs them. If it cannot, it prints the command to be run and fails.
# SAGA_NO_SETUP=1 skips it. FOR is
#   build      (the default) what `make` needs
#   check      also that for the programs of tests/
#   test       also the machines, the browser and npm of `make test`
#   packages   what makes the packages of debian/
#   all        all of these, and every compiler of `make test-all`
#   lint, prove, plot   build, and clang-tidy, Frama-C, or what draws plots
set -eu

test -z "${SAGA_NO_SETUP:-}" || exit 0

build="gcc make binutils libc6-dev clang lld pkg-config python3
    libjansson-dev libpng-dev libtiff-dev libturbojpeg0-dev zlib1g-dev
    libwebp-dev libzstd-dev libopenexr-dev libqrencode-dev libvulkan-dev
    libvulkan-volk-dev ffmpeg"
# Without a GPU, kernels are tested on the driver that computes on the CPU.
check="$build libcmocka-dev glslang-tools spirv-tools mesa-vulkan-drivers
    vulkan-validationlayers"
# `npm pack` fetches the engines that tests use.
test="$check clang-format g++ gcc-arm-none-eabi gcc-s390x-linux-gnu
    libc6-dev-s390x-cross qemu-user-static qemu-system-arm chromium desktop-file-utils libglib2.0-bin shared-mime-info
    $(command -v npm >/dev/null || echo npm)"
packages="debhelper dh-python dpkg-dev lintian"
case ${1:-build} in
build) packages=$build ;;
check) packages=$check ;;
test) packages=$test ;;
packages) packages="$build $packages" ;;
all)
    packages="$test $packages cmake clang-tidy
    python3-opencv slurm-wlm munge parallel openmpi-bin
    gcc-aarch64-linux-gnu libc6-dev-arm64-cross
    gcc-arm-linux-gnueabihf libc6-dev-armhf-cross
    gcc-riscv64-linux-gnu libc6-dev-riscv64-cross
    gcc-powerpc-linux-gnu libc6-dev-powerpc-cross
    gcc-mips-linux-gnu libc6-dev-mips-cross
    gcc-i686-linux-gnu libc6-dev-i386-cross
    gcc-riscv64-unknown-elf gcc-mingw-w64-x86-64-win32 wine wine64"
    ;;
lint) packages="$build clang-tidy" ;;
prove) packages="$build frama-c-base" ;;
plot) packages="$build gnuplot-nox valgrind" ;;
*)
    echo "setup: '$1' is not build, check, test, packages, all, lint, prove" \
        "or plot"
    exit 2
    ;;
esac

# The name of the sanitizers' library contains clang's version.
clang_rt() {
    for ask in "dpkg-query -W -f \${Depends}" "apt-cache depends"; do
        v=$($ask clang 2>/dev/null |
            sed -n 's/.*clang-\([0-9][0-9]*\).*/\1/p' | head -n 1)
        [ -z "$v" ] || { echo "libclang-rt-$v-dev"; return; }
    done
}

find_missing() {
    # shellcheck disable=SC2046,SC2086
    set -- $packages $(case $packages in *qemu*) clang_rt ;; esac)
    installed=" $(dpkg-query -W -f '${Package} ${db:Status-Status}\n' "$@" \
        2>/dev/null | sed -n 's/ installed$//p' | tr '\n' ' ')"
    missing=
    for p in "$@"; do
        case $installed in
        *" $p "*) ;;
        *) missing="$missing $p" ;;
        esac
    done
}

if ! command -v apt-get >/dev/null || ! command -v dpkg-query >/dev/null; then
    echo "setup: this is not Debian. Install the equivalents of:" $packages
    echo "setup: then run again with SAGA_NO_SETUP=1"
    exit 1
fi

find_missing
test -n "$missing" || exit 0

opts="-o DPkg::Lock::Timeout=300"
give_up() {
    echo "setup: cannot install the packages ($1). As root, run:"
    echo "apt-get $opts update && apt-get $opts install -y" \
        "--no-install-recommends$missing"
    exit 1
}

[ "$(id -u)" = 0 ] || give_up "not root"
echo "setup: installs with apt-get, unless SAGA_NO_SETUP=1 is set:$missing"
export DEBIAN_FRONTEND=noninteractive
log=$(mktemp)
trap 'rm -f "$log"' EXIT
# The mirror may be down although packages are in the cache, so a failed update
# is no error yet.
apt-get $opts update -qq </dev/null >"$log" 2>&1 || cat "$log"
find_missing # apt-cache knows clang only now
apt-get $opts install -y -qq --no-install-recommends $missing \
    </dev/null >"$log" 2>&1 || {
    cat "$log"
    give_up "apt-get install failed"
}
find_missing
test -z "$missing" || give_up "still missing"
