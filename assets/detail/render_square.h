#pragma once

#include <functional>

#include "assets/detail/preview_scene.h"
#include "assets/image.h"

namespace sinew::assets::detail {

/// Linear light that a camera receives from a unit direction.
using LightFrom = std::function<Eigen::Vector3d(const Eigen::Vector3d& direction, const LightSamples&)>;

/// Fills the square of `size` pixels at (left, top) with what `camera` sees, several rays a pixel.
/// `light_from` is called from several threads.
void render_square(Image& image, int left, int top, int size, const Camera& camera,
                   const LightFrom& light_from);

}  // namespace sinew::assets::detail
