/* SPDX-License-Identifier: MIT
 *
 * run_prove.py includes this before everything. Eva analyses the plain C code.
 * A failing FX_ASSERT calls a function that must not be called.
 */
#undef __x86_64__
#undef __SSE2__
#define _Static_assert(condition, text)
#define __builtin_trap prove_trap
/*@ requires not_reached: \false; assigns \nothing; */
void prove_trap(void);
