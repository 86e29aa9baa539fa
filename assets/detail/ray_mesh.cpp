#include "assets/detail/ray_mesh.h"

#include <limits>

#include <embree3/rtcore.h>
#include <tbb/task_arena.h>

#include "assets/error.h"

namespace sinew::assets::detail {
namespace {

RTCRay make_ray(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, double reach) {
  RTCRay ray{};
  ray.org_x = static_cast<float>(origin.x());
  ray.org_y = static_cast<float>(origin.y());
  ray.org_z = static_cast<float>(origin.z());
  ray.dir_x = static_cast<float>(direction.x());
  ray.dir_y = static_cast<float>(direction.y());
  ray.dir_z = static_cast<float>(direction.z());
  ray.tnear = 0.0f;
  ray.tfar = static_cast<float>(reach);
  ray.mask = ~0u;
  return ray;
}

}  // namespace

struct RayMesh::Impl {
  RTCDevice device = nullptr;
  RTCScene scene = nullptr;
  ~Impl() {
    if (scene != nullptr) rtcReleaseScene(scene);
    if (device != nullptr) rtcReleaseDevice(device);
  }
};

RayMesh::RayMesh(const lattice::Points& points, const lattice::Triangles& triangles)
    : impl_(std::make_unique<Impl>()) {
  impl_->device = rtcNewDevice("set_affinity=0");
  if (impl_->device == nullptr) throw LimitError("preview: the ray tracer does not start");
  impl_->scene = rtcNewScene(impl_->device);
  rtcSetSceneFlags(impl_->scene, RTC_SCENE_FLAG_ROBUST);
  RTCGeometry geometry = rtcNewGeometry(impl_->device, RTC_GEOMETRY_TYPE_TRIANGLE);
  const auto num_points = static_cast<std::size_t>(points.rows());
  const auto num_triangles = static_cast<std::size_t>(triangles.rows());
  auto* vertices = static_cast<float*>(rtcSetNewGeometryBuffer(
      geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float), num_points));
  auto* indices = static_cast<unsigned*>(rtcSetNewGeometryBuffer(
      geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(unsigned), num_triangles));
  if (vertices == nullptr || indices == nullptr) {
    rtcReleaseGeometry(geometry);
    throw LimitError("preview: no memory for " + std::to_string(num_triangles) + " triangles");
  }
  for (std::size_t i = 0; i < 3 * num_points; ++i) vertices[i] = static_cast<float>(points.data()[i]);
  for (std::size_t i = 0; i < 3 * num_triangles; ++i) indices[i] = static_cast<unsigned>(triangles.data()[i]);
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(impl_->scene, geometry);
  rtcReleaseGeometry(geometry);
  // One thread builds the tree, so that it is the same tree on every machine. Not by the device's own option:
  // that holds all of TBB to one thread for as long as the device lives.
  tbb::task_arena(1).execute([&] { rtcCommitScene(impl_->scene); });
}

RayMesh::~RayMesh() = default;
RayMesh::RayMesh(RayMesh&&) noexcept = default;
RayMesh& RayMesh::operator=(RayMesh&&) noexcept = default;

std::optional<RayMesh::Hit> RayMesh::first_hit(const Eigen::Vector3d& origin,
                                               const Eigen::Vector3d& direction) const {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  RTCRayHit query{};
  query.ray = make_ray(origin, direction, std::numeric_limits<double>::infinity());
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  rtcIntersect1(impl_->scene, &context, &query);
  if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return std::nullopt;
  return Hit{static_cast<int>(query.hit.primID),
             query.ray.tfar,
             query.hit.u,
             query.hit.v,
             {query.hit.Ng_x, query.hit.Ng_y, query.hit.Ng_z}};
}

bool RayMesh::is_blocked(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                         double reach) const {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  RTCRay ray = make_ray(origin, direction, reach);
  rtcOccluded1(impl_->scene, &context, &ray);
  return ray.tfar < 0.0f;  // Embree marks a blocked ray so
}

}  // namespace sinew::assets::detail
