#include "proto/options/image_options.h"

#include "proto/limits.h"
#include "proto/options/codecs.h"
#include "proto/options/words.h"

namespace voxeld {
namespace {

using namespace option_codecs;
namespace words = option_words;

// When canonical JSON has an option that is not always there.
bool is_several_images(const RequestOptions& options) {
  return options.render.image != ImageKind::kPng;
}
bool is_later_frame(const RequestOptions& options) {
  return options.render.frame > 0;
}

}  // namespace

std::vector<Option> image_options() {
  using R = RenderOptions;
  return {
      {.name = "width",
       .codec = integer(&R::width, 1, limits::kRenderSideMax),
       .help = "width of an image in pixels",
       .default_words = "512, in a sheet 160"},
      {.name = "height",
       .codec = integer(&R::height, 1, limits::kRenderSideMax),
       .help = "height of an image in pixels",
       .default_words = "512, in a sheet 160"},
      {.name = "style",
       .codec = word(&R::style, words::kStyle),
       .help = "cubes with edges, smooth surface, shape alone, fixed light from above, or outlines",
       .details = "`iso` looks from 45 and 35.26 degrees and lights tops by 1, sides by 0.78 and "
                  "0.64 and bottoms by 0.5 of their colour, so that colours compare between "
                  "images. `clay` leaves colours away."},
      {.name = "projection",
       .codec = word(&R::projection, words::kProjection),
       .help = "projection of the camera",
       .default_words = "perspective; orthographic in style iso and blueprint"},
      {.name = "azimuth",
       .form = "DEGREES",
       .codec = number(&R::azimuth_deg, -3600, 3600),
       .help = "camera's angle around +y; 0 looks from +z",
       .default_words = "30; 45 in style iso"},
      {.name = "elevation",
       .form = "DEGREES",
       .codec = number(&R::elevation_deg, -90, 90),
       .help = "camera's angle above the horizon",
       .default_words = "20; 35.26 in style iso"},
      {.name = "zoom",
       .form = "F",
       .codec = number(&R::zoom, 0.01, 1000),
       .help = "magnification: 1 fits the voxels into the image, more is closer"},
      {.name = "matrix",
       .form = "16 numbers",
       .codec = numbers(&R::matrix),
       .help =
           "row-major clip_from_world matrix, instead of projection, azimuth, elevation and zoom"},
      {.name = "background",
       .form = "#RRGGBB[AA] | transparent",
       .codec = background(),
       .help = "sRGB colour behind the grid",
       .default_words = "a light gradient; white in style smooth and in a GIF, grey in style iso, "
                        "blue in style blueprint"},
      {.name = "occlusion",
       .codec = word(&R::occlusion, words::kYesNo),
       .help = "ambient occlusion: corners are darker",
       .default_words = "yes in style voxel, clay and iso"},
      {.name = "shadow",
       .codec = word(&R::shadow, words::kYesNo),
       .help = "soft shadow of the key light",
       .default_words = "yes in style voxel and clay"},
      {.name = "ground",
       .codec = word(&R::ground, words::kYesNo),
       .help = "floor under the grid, which shows its shadow alone and fades out",
       .default_words = "yes in style voxel and clay"},
      {.name = "exposure",
       .form = "F",
       .codec = number(&R::exposure, 1, limits::kExposureMax),
       .help = "factor by which dark colours are brighter; white stays white",
       .default_words = "by the median of the colours; 1 in style iso"},
      {.name = "samples",
       .codec = samples(),
       .help = "rays along each side of a pixel; 1 is quick",
       .details = "`auto`: 2, and 1 above a million pixels."},
      {.name = "renderer",
       .codec = word(&R::renderer, words::kRenderer),
       .help = "what draws the image; auto: the GPU, or the CPU if GL is a software driver"},
      {.name = "section",
       .form = "A,B,C,D",
       .codec = section(),
       .help = "plane that cuts away the cells where A x + B y + C z + D > 0"},
  };
}

std::vector<Option> several_images_options() {
  using R = RenderOptions;
  return {
      {.name = "image",
       .codec = word(&R::image, words::kImage),
       .help = "one image, or all frames or views as an animation or side by side",
       .is_written = is_several_images},
      {.name = "frame",
       .form = "K",
       .codec = integer(&R::frame, 0, limits::kFramesMax - 1),
       .help = "image png: number of the frame among the requested ones, from 0",
       .is_written = is_later_frame},
      {.name = "turntable",
       .codec = integer(&R::turntable, limits::kTurntableViewsMin, limits::kTurntableViewsMax),
       .help = "image gif, apng and sheet: number of views around one grid"},
      {.name = "rate",
       .form = "F",
       .codec = number(&R::rate, limits::kImageRateMin, limits::kImageRateMax),
       .help = "image gif and apng: images per second",
       .default_words = "the sequence's own times; 24 for a turntable"},
      {.name = "columns",
       .codec = integer(&R::columns, 1, limits::kFramesMax),
       .help = "image sheet: images in a row",
       .default_words = "as many as rows"},
  };
}

}  // namespace voxeld
