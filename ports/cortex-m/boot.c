/* SPDX-License-Identifier: MIT
 *
 * Support for Cortex-M3 and later without a C library: vectors, reset, the
 * timer, and the four functions that a compiler may call on its own.
 */
#include "boot.h"

#include "semihost.h"

#include <stddef.h>

/* These symbols are defined in firmware.ld. */
extern uint32_t boot_stack[], boot_stack_top[], boot_bss[], boot_bss_end[];

int main(void);
void boot_reset(void);

/* --- Functions that compilers call --------------------------------------- */

void *memcpy(void *to, const void *from, size_t n);
void *memmove(void *to, const void *from, size_t n);
void *memset(void *to, int x, size_t n);
int memcmp(const void *a, const void *b, size_t n);

void *memcpy(void *to, const void *from, size_t n)
{
    unsigned char *t = to;
    const unsigned char *f = from;

    while (n--)
        *t++ = *f++;
    return to;
}

void *memmove(void *to, const void *from, size_t n)
{
    unsigned char *t = to;
    const unsigned char *f = from;

    if ((uintptr_t)to <= (uintptr_t)from)
        return memcpy(to, from, n);
    while (n--)
        t[n] = f[n];
    return to;
}

void *memset(void *to, int x, size_t n)
{
    unsigned char *t = to;

    while (n--)
        *t++ = (unsigned char)x;
    return to;
}

int memcmp(const void *a, const void *b, size_t n)
{
    const unsigned char *p = a, *q = b;

    for (; n; n--, p++, q++)
        if (*p != *q)
            return *p < *q ? -1 : 1;
    return 0;
}

/* --- The timer ----------------------------------------------------------- */

#define SYSTICK_CONTROL (*(volatile uint32_t *)0xe000e010u)
#define SYSTICK_RELOAD (*(volatile uint32_t *)0xe000e014u)
#define SYSTICK_VALUE (*(volatile uint32_t *)0xe000e018u)
/* Bits that enable it, with interrupts, on the processor clock. */
#define SYSTICK_ON 7u
#define SYSTICK_MOST 0xffffffu /* it counts down from this value (24 bits) */

static volatile uint32_t turns;

static void on_tick(void)
{
    turns++;
}

static void start_timer(void)
{
    SYSTICK_RELOAD = SYSTICK_MOST;
    SYSTICK_VALUE = 0;
    SYSTICK_CONTROL = SYSTICK_ON;
    while (SYSTICK_VALUE == 0) /* reloading takes a clock cycle */
        ;
}

uint64_t boot_ticks(void)
{
    uint32_t before, value;

    do {
        before = turns;
        value = SYSTICK_VALUE;
    } while (turns != before);
    return ((uint64_t)before << 24) + (SYSTICK_MOST - value);
}

/* --- Reset --------------------------------------------------------------- */

#define FILLING 0x5a5a5a5au
#define CPACR (*(volatile uint32_t *)0xe000ed88u)
#define CPACR_VECTORS (15u << 20)

uint32_t boot_stack_nbytes(void)
{
    const uint32_t *p = boot_stack;

    while (p < boot_stack_top && *p == FILLING)
        p++;
    return (uint32_t)(uintptr_t)boot_stack_top - (uint32_t)(uintptr_t)p;
}

static void on_fault(void)
{
    semihost_text("FAIL the processor faults\n");
    semihost_exit(3);
}

/* Starts the program. It first turns on the vector unit, which a Cortex-M55 has
 * off after reset; processors without one ignore this. Then it fills the unused
 * stack with a pattern, from which boot_stack_nbytes finds how much was used.
 */
void boot_reset(void)
{
    uint32_t *const here = __builtin_frame_address(0);
    uint32_t *p;

    CPACR |= CPACR_VECTORS;
    __asm__ volatile("dsb\n\tisb" : : : "memory");
    for (p = boot_bss; p < boot_bss_end; p++)
        *p = 0;
    for (p = boot_stack; p < here - 16; p++)
        *p = FILLING;
    start_timer();
    semihost_exit(main());
}

typedef void (*handler)(void);

/* The vector table: the stack's top, reset, and the exceptions 2 to 15. */
static const struct {
    uint32_t *stack;
    handler reset, exception[14];
} vectors __attribute__((section(".vectors"), used)) = {
    boot_stack_top,
    boot_reset,
    { on_fault, on_fault, on_fault, on_fault, on_fault, on_fault, on_fault,
      on_fault, on_fault, on_fault, on_fault, on_fault, on_fault, on_tick }
};
