#include <cmath>
#include <cstdio>
#include <exception>
#include <random>

#include "assets/atomic_output.h"
#include "assets/obj.h"
#include "assets/pc2.h"
#include "assets/sidecar.h"

/// Writes a folder of outputs of two wobbling sheets for a reader to prove itself on: make_cache OUT.
namespace {

using namespace sinew;

constexpr int kColumns = 23, kRows = 17, kNumFrames = 10, kFirstFrame = 101;

assets::NamedMesh sheet(const std::string& name, double height) {
  assets::NamedMesh mesh;
  mesh.name = name;
  mesh.points.resize(kColumns * kRows, 3);
  mesh.triangles.resize(2 * (kColumns - 1) * (kRows - 1), 3);
  Eigen::Index t = 0;
  for (int r = 0; r < kRows; ++r) {
    for (int c = 0; c < kColumns; ++c) {
      mesh.points.row(r * kColumns + c) << 0.1 * c, height, 0.1 * r;
      if (r + 1 == kRows || c + 1 == kColumns) continue;
      const int v = r * kColumns + c;
      mesh.triangles.row(t++) << v, v + kColumns, v + 1;
      mesh.triangles.row(t++) << v + 1, v + kColumns, v + kColumns + 1;
    }
  }
  return mesh;
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc != 2) {
    std::fprintf(stderr, "usage: make_cache OUT\n");
    return 2;
  }
  assets::OutputDirectory out(argv[1], assets::Overwrite::Replace, {"skin.obj", "skin.pc2", "skin.json"});
  const std::vector<assets::NamedMesh> parts = {sheet("lower sheet", 0.0), sheet("upper sheet", 1.0 / 3.0)};
  lattice::Points rest(2 * kColumns * kRows, 3);
  rest << parts[0].points, parts[1].points;
  assets::write_file(out.file("skin.obj"), assets::obj_text(parts), assets::Overwrite::Refuse);
  assets::Pc2Writer cache(out.file("skin.pc2"), static_cast<int>(rest.rows()), kFirstFrame);
  std::mt19937_64 rng(20021);
  for (int frame = 0; frame < kNumFrames; ++frame) {
    // Every bit of the mantissa and exponents from 2^-60 to 2^3: nothing a reader could round and get away
    // with.
    lattice::Points points = rest;
    for (Eigen::Index i = 0; i < points.size(); ++i) {
      const auto mantissa = static_cast<double>(static_cast<std::int64_t>(rng()));
      points.data()[i] += std::ldexp(mantissa, -60 - static_cast<int>(rng() % 60));
    }
    cache.write(points);
  }
  cache.finish();
  assets::Sidecar sidecar;
  sidecar.version = "test";
  sidecar.rest_mesh = "skin.obj";
  sidecar.cache = "skin.pc2";
  sidecar.rest = assets::to_float(rest);
  for (const assets::NamedMesh& part : parts)
    sidecar.parts.push_back({part.name, static_cast<int>(part.points.rows())});
  sidecar.fps = 24.0;
  sidecar.first_frame = kFirstFrame;
  sidecar.num_frames = kNumFrames;
  assets::write_file(out.file("skin.json"), assets::sidecar_json(sidecar), assets::Overwrite::Refuse);
  out.commit();
  return 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
