#pragma once

#include <string>
#include <utility>
#include <vector>

#include "assets/image.h"
#include "assets/rig.h"
#include "lattice/points.h"

/// The contact sheet: frames of the simulation above plain skinning of the same frames.
namespace sinew::assets {

/// One column of the sheet. All positions [m], in one space.
struct PreviewFrame {
  int frame = 0;                                                   ///< number printed.
  double time = 0.0;                                               ///< printed [s].
  lattice::Points simulated, skinned;                              ///< num_vertices x 3 each.
  std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>> bones;  ///< segments drawn over the flesh.
};

struct PreviewOptions {
  /// Width and height of one picture of the sheet [pixels]; >= 64.
  int tile = 320;
  UpAxis up_axis = UpAxis::Y;
  /// Printed at the top right, for example the names of the character and the clip.
  std::string caption = {};
  /// Printed above the two rows of pictures.
  std::string upper = "sinew", lower = "plain skinning";
  /// Linear RGB of every vertex, num_vertices x 3; empty = flesh all over.
  lattice::Points colours = {};

  /// Throws std::invalid_argument naming the field.
  void validate() const;
};

/// Colours by the roles of the parts: what is simulated looks like flesh, what only follows is dark.
lattice::Points role_colours(const Rig& rig);

/// Which of `num_frames` frames to show: at most `count`, equally spaced, the first and the last among them.
std::vector<int> preview_frames(int num_frames, int count = 8);

/// Renders the sheet: one three-quarter camera for all tiles, fitted to everything that moves; soft daylight,
/// ground under the lowest point; the flesh is tinted where it is away from plain skinning. The same input
/// gives the same pixels, for any number of threads. Throws std::invalid_argument where there is no frame,
/// the frames differ in size, an index is out of range or a coordinate is not finite.
Image render_preview(const lattice::Triangles& triangles, const std::vector<PreviewFrame>& frames,
                     const PreviewOptions& options = {});

/// Renders and writes a PNG. Throws IoError naming the file.
void write_preview(const std::string& file, const lattice::Triangles& triangles,
                   const std::vector<PreviewFrame>& frames, const PreviewOptions& options = {});

}  // namespace sinew::assets
