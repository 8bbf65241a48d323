/* The decoder of native containers (.voxg) in C, for other languages: the Python package loads it
 * by ctypes. Part of libvoxeld_client.
 *
 * A grid is decoded once and then copied into arrays of the caller. Each array has a row for each
 * voxel, by ascending Morton code of its cell (bit k of x, y and z is bit 3k, 3k+1 and 3k+2), as in
 * format npz with layout sparse. A grid may be read by several threads at once.
 */
#ifndef VOXELD_DECODE_H
#define VOXELD_DECODE_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define VOXELD_C_API __attribute__((visibility("default")))

typedef struct voxeld_grid voxeld_grid;

/* Cell (x,y,z) covers origin + voxel_size * [x,x+1) x [y,y+1) x [z,z+1). */
typedef struct voxeld_grid_info {
  double origin[3];     /* world units */
  double voxel_size[3]; /* world units */
  uint64_t voxel_count;
  const char* meta_json; /* UTF-8, ends with a zero byte; valid until the grid is freed */
  int32_t dims[3];       /* cells in x, y and z */
  uint32_t channels;     /* bit i: the grid has channel i */
} voxeld_grid_info;

/* The channels and the type of a row. Voxels inside a solid have no attributes: their rows are 0,
 * their coverage is 255, and their distance is the farthest one inside.
 */
enum voxeld_channel {
  VOXELD_COLOR = 0,    /* uint8_t[4]: sRGB R, G, B and linear A */
  VOXELD_NORMAL = 1,   /* int8_t[3]: unit normal times 127 */
  VOXELD_MATERIAL = 2, /* uint16_t: an id from 1 on; 0: none */
  VOXELD_LABEL = 3,    /* uint16_t: likewise */
  VOXELD_DISTANCE = 4, /* float: to the mesh, negative inside; in voxels, or in world units if
                        * meta_json has {"options": {"distance": "world"}} */
  VOXELD_COVERAGE = 5  /* uint8_t: 255: the whole voxel is covered */
};

/* Decodes a container of `size` bytes on all cores. NULL on failure; then `error` has the reason as
 * UTF-8, cut to error_size bytes with a zero byte at the end. The bytes are not needed afterwards.
 */
VOXELD_C_API voxeld_grid* voxeld_grid_decode(const void* bytes, size_t size, char* error,
                                             size_t error_size);
/* Accepts NULL. */
VOXELD_C_API void voxeld_grid_free(voxeld_grid* grid);

VOXELD_C_API void voxeld_grid_get_info(const voxeld_grid* grid, voxeld_grid_info* info);
/* Fills voxel_count rows of x, y, z. */
VOXELD_C_API void voxeld_grid_get_coords(const voxeld_grid* grid, int32_t* coords);
/* Fills voxel_count rows of a channel. Returns 1; 0, without a change, if the grid lacks it. */
VOXELD_C_API int voxeld_grid_get_channel(const voxeld_grid* grid, int channel, void* rows);
/* Sets the byte of every occupied cell to 1, of dims[0]*dims[1]*dims[2] bytes, x fastest. The
 * others are left alone: pages of zeroed memory without a voxel are then never touched.
 */
VOXELD_C_API void voxeld_grid_mark_occupied(const voxeld_grid* grid, uint8_t* cells);

#ifdef __cplusplus
}
#endif

#endif
