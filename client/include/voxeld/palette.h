/* The reader of palette files in C, for other languages: the Python package loads it by ctypes.
 * Part of libvoxeld_client.
 */
#ifndef VOXELD_PALETTE_H
#define VOXELD_PALETTE_H

#include <stddef.h>
#include <stdint.h>

#include "decode.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The most colours of a palette. */
#define VOXELD_PALETTE_COLORS 256

/* Reads the colours of a palette file of `size` bytes: .gpl .pal .act .aco .ase .hex .png; its name
 * tells formats without a signature. Fills `colors` with their sRGB red, green and blue, in the
 * file's order and each once, and returns how many they are. 0 on failure; then `error` has the
 * reason as UTF-8, cut to error_size bytes with a zero byte at the end.
 */
VOXELD_C_API int voxeld_palette_read(const void* bytes, size_t size, const char* filename,
                                     uint8_t colors[3 * VOXELD_PALETTE_COLORS], char* error,
                                     size_t error_size);

#ifdef __cplusplus
}
#endif

#endif
