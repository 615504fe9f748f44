/* SPDX-License-Identifier: MIT */
#include "semihost.h"

/* The operations, from Arm's "Semihosting for AArch32 and AArch64". */
enum {
    SYS_OPEN = 0x01,
    SYS_CLOSE = 0x02,
    SYS_WRITE0 = 0x04,
    SYS_WRITE = 0x05,
    SYS_GET_CMDLINE = 0x15,
    SYS_EXIT_EXTENDED = 0x20
};

enum { OPEN_WRITE_BINARY = 5 };
#define STOPPED_BY_EXIT 0x20026u

static int call(int operation, const void *block)
{
    register int r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = block;

    __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

static uint32_t address(const void *p)
{
    return (uint32_t)(uintptr_t)p;
}

static size_t length(const char *text)
{
    size_t n = 0;

    while (text[n])
        n++;
    return n;
}

void semihost_text(const char *text)
{
    call(SYS_WRITE0, text);
}

static void number(uint32_t x, uint32_t base, int n_digits)
{
    char text[11];
    int i = 10;

    text[i] = '\0';
    do {
        text[--i] = "0123456789abcdef"[x % base];
        x /= base;
    } while (x || 10 - i < n_digits);
    semihost_text(text + i);
}

void semihost_decimal(uint32_t x)
{
    number(x, 10, 1);
}

void semihost_hex(uint32_t x)
{
    number(x, 16, 8);
}

void semihost_arguments(char *text, size_t n)
{
    uint32_t block[2] = { address(text), (uint32_t)n };
    size_t i = 0, k = 0;

    if (call(SYS_GET_CMDLINE, block) != 0)
        block[1] = 0;
    while (i < block[1] && text[i] != ' ')
        i++;
    while (i + 1 < block[1])
        text[k++] = text[++i];
    text[k < n ? k : n - 1] = '\0';
}

int semihost_create(const char *path)
{
    const uint32_t block[3] = { address(path), OPEN_WRITE_BINARY,
                                (uint32_t)length(path) };

    return call(SYS_OPEN, block);
}

int semihost_write(int file, const void *p, size_t n)
{
    const uint32_t block[3] = { (uint32_t)file, address(p), (uint32_t)n };

    return call(SYS_WRITE, block) == 0; /* bytes not written */
}

void semihost_close(int file)
{
    const uint32_t block = (uint32_t)file;

    call(SYS_CLOSE, &block);
}

void semihost_exit(int status)
{
    const uint32_t block[2] = { STOPPED_BY_EXIT, (uint32_t)status };

    for (;;)
        call(SYS_EXIT_EXTENDED, block);
}
