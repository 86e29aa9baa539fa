#include "assets/detail/render_square.h"

#include <cmath>

#include <tbb/parallel_for.h>

namespace sinew::assets::detail {

void render_square(Image& image, int left, int top, int size, const Camera& camera,
                   const LightFrom& light_from) {
  constexpr int kSubpixels = 2;  // in each direction
  tbb::parallel_for(0, size, [&](int y) {
    for (int x = 0; x < size; ++x) {
      const Eigen::Vector2d shift = light_shift(x, y);
      Eigen::Vector3d sum = Eigen::Vector3d::Zero();
      for (int sub = 0; sub < kSubpixels * kSubpixels; ++sub) {
        const Eigen::Vector2d place(x + (sub % kSubpixels + 0.5) / kSubpixels,
                                    y + (sub / kSubpixels + 0.5) / kSubpixels);
        const Eigen::Vector3d light = light_from(camera.direction(place / size), {shift, sub});
        sum += light.cwiseMin(1.0);  // clipped before averaging, so that bright edges stay smooth
      }
      const Eigen::Vector3d srgb = encode(sum / (kSubpixels * kSubpixels));
      for (int c = 0; c < 3; ++c)
        image.rgb[static_cast<std::size_t>(3 * ((top + y) * image.width + left + x) + c)] =
            static_cast<std::uint8_t>(std::lround(255.0 * srgb[c]));
    }
  });
}

}  // namespace sinew::assets::detail
