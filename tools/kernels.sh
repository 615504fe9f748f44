#!/bin/sh
# SPDX-License-Identifier: MIT
#
# kernels.sh [head]: prints trainer/gpu/kernels.c, that is, the kernels of
# trainer/gpu/kernels in SPIR-V, in the order of SAGA_KERNEL_LIST (compute.h);
# or (head) only its lines with the checksum of the sources and the versions of
# the compilers.
set -eu
cd "$(dirname "$0")/../trainer/gpu"

head() {
    echo " * Sources: $(cat kernels/*.glsl kernels/*.comp | sha256sum |
        cut -d' ' -f1)"
    echo " * Compilers: $(glslangValidator --version 2>&1 |
        sed -n 's/^Glslang Version: [0-9]*:/glslang /p')," \
        "$(spirv-opt --version 2>&1 |
            sed -n 's/^SPIRV-Tools v\([^ ]*\).*/spirv-tools \1/p')"
}
if [ "${1:-}" = head ]; then
    head
    exit
fi

tmp=$(mktemp -d)
trap 'rm -rf "$tmp"' EXIT

names=$(sed -n 's/^ *X([A-Z_0-9]*, \([a-z_0-9]*\), [0-9]*).*/\1/p' compute.h)
for name in $names; do
    glslangValidator -V --target-env vulkan1.1 -Ikernels \
        "kernels/$name.comp" -o "$tmp/raw" >"$tmp/log" ||
        { cat "$tmp/log" >&2; exit 1; }
    spirv-opt --target-env=vulkan1.1 -O --strip-debug "$tmp/raw" \
        -o "$tmp/$name"
    spirv-val --target-env vulkan1.1 "$tmp/$name"
done

echo '/* SPDX-License-Identifier: MIT'
echo ' *'
echo ' * Made by `make kernels`; tests/check_kernels.sh compares.'
head
echo ' */'
echo '#include "compute.h"'
echo
for name in $names; do
    echo "static const uint32_t $name[] = {"
    od -An -v -w1000 -tu4 "$tmp/$name" | sed 's/^  *//; s/  */,/g; s/$/,/'
    echo '};'
done
cat <<'END'

#define KERNEL(word, name, n) { #name, n, name, sizeof name },

const saga_gpu_kernel saga_gpu_kernels[SAGA_N_KERNELS] = { SAGA_KERNEL_LIST(
    KERNEL) };
END
