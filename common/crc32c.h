/* SPDX-License-Identifier: MIT
 *
 * CRC-32C (Castagnoli): polynomial 0x1edc6f41 reflected, start and final
 * exclusive-or 0xffffffff. "123456789" gives 0xe3069283.
 */
#ifndef SAGA_CRC32C_H
#define SAGA_CRC32C_H

#include <stddef.h>
#include <stdint.h>

/* Returns crc continued over p[0..n); crc is 0 at the start. */
uint32_t saga_crc32c(uint32_t crc, const uint8_t *p, size_t n);

#endif
