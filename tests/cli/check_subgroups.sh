#!/bin/bash
# SPDX-License-Identifier: MIT
#
# check_subgroups.sh: guarantees that the kernels assume no size of a subgroup:
# the tests of tests/gpu pass on Mesa's driver for processors with vectors of
# 128 and of 512 bits, which are subgroups of 4 and of 16 (`make test` has 8),
# and Vulkan's validation layers find nothing in them. Without the driver or
# the layers, what needs them is skipped, which is said.
# shellcheck disable=SC2034,SC2154,SC1091
set -u
cd "$(dirname "$0")/../.." || exit
build=${BUILD:-build}
[ ! -d "$build/gcc" ] || build=$build/gcc # of run_tests.sh

checks=subgroups
. tests/cli/verdict.sh

driver=$(find /usr/share/vulkan/icd.d -name 'lvp_icd*.json' 2>/dev/null |
    head -n 1)
layer=VK_LAYER_KHRONOS_validation
sync=VK_VALIDATION_FEATURE_ENABLE_SYNCHRONIZATION_VALIDATION_EXT
if [ -z "$driver" ]; then
    echo "ok   $checks: skipped, mesa-vulkan-drivers is not installed"
    exit
fi
export VK_ICD_FILENAMES=$driver VK_DRIVER_FILES=$driver SAGA_TEST_GPU=0
if [ -e /usr/share/vulkan/explicit_layer.d/VkLayer_khronos_validation.json ]
then
    export VK_INSTANCE_LAYERS=$layer VK_LAYER_ENABLES=$sync
fi
for width in 128 512; do
    for program in test_compute test_gpu_splat test_gpu_blocks \
        test_gpu_networks test_gpu_rates test_fit_stay; do
        LP_NATIVE_VECTOR_WIDTH=$width timeout 600 "$build/$program" \
            >"$tmp/log" 2>&1 </dev/null || complain "exit status $?"
        # Mesa names the width that it uses, in the device's name.
        grep -q "$width bits" "$tmp/log" || complain "not $width bits wide"
        grep -hE 'FAILED|Validation|VUID|SYNC-HAZARD' "$tmp/log" >>"$bad"
        verdict "$program with $width bits"
    done
done
all_passed
