#include "assets/detail/lattice_json.h"

#include <algorithm>
#include <array>
#include <map>

#include <nlohmann/json.hpp>

#include "assets/error.h"

namespace sinew::assets::detail {
namespace {

using Json = nlohmann::ordered_json;
using Eigen::Vector3d;

constexpr int kVersion = 2;  // 2: regions, coincident vertices, copies

Json to_json(const Vector3d& p) { return Json::array({p.x(), p.y(), p.z()}); }

Json to_json(const lattice::BoneAnchor& anchor, const std::vector<std::string>& names) {
  return {{"joint_a", names[anchor.joint_a]},
          {"joint_b", names[anchor.joint_b]},
          {"x_a", to_json(anchor.x_a)},
          {"x_b", to_json(anchor.x_b)}};
}

/// Reads keys and turns what is missing or of the wrong type into one line.
class JsonReader {
 public:
  JsonReader(const std::string& where, const lattice::JointTree& joints) : where_(where) {
    for (int j = 0; j < static_cast<int>(joints.names.size()); ++j) joint_of_.emplace(joints.names[j], j);
  }

  [[noreturn]] void fail(const std::string& what) const { throw InputError(where_, what); }

  const Json& at(const Json& object, const char* key) const {
    if (!object.is_object() || !object.contains(key)) fail(std::string("key '") + key + "' is missing");
    return object[key];
  }
  template <class T>
  T get(const Json& object, const char* key) const {
    try {
      return at(object, key).get<T>();
    } catch (const nlohmann::json::exception&) {
      fail(std::string("key '") + key + "' has the wrong type");
    }
  }
  Vector3d point(const Json& object, const char* key) const {
    const auto values = get<std::vector<double>>(object, key);
    if (values.size() != 3)
      fail(std::string("key '") + key + "': got " + std::to_string(values.size()) + " numbers, expected 3");
    return {values[0], values[1], values[2]};
  }
  int joint(const std::string& name) const {
    const auto found = joint_of_.find(name);
    if (found == joint_of_.end())
      fail("joint '" + name + "' is not in the rig; hint: take the rig that the lattice was built for");
    return found->second;
  }
  int joint(const Json& object, const char* key) const { return joint(get<std::string>(object, key)); }
  lattice::BoneAnchor anchor(const Json& object, const char* key) const {
    const Json& a = at(object, key);
    return {joint(a, "joint_a"), joint(a, "joint_b"), point(a, "x_a"), point(a, "x_b")};
  }

 private:
  const std::string& where_;
  std::map<std::string, int> joint_of_;
};

Json bone_to_json(const lattice::LatticeBone& bone, const std::vector<std::string>& names) {
  return {{"name", bone.name},
          {"frame", names[bone.frame]},
          {"start", to_json(bone.start, names)},
          {"end", to_json(bone.end, names)},
          {"rest_start", to_json(bone.rest_start)},
          {"rest_end", to_json(bone.rest_end)},
          {"chain", bone.chain},
          {"soft", bone.soft},
          {"tip", bone.tip}};
}

lattice::LatticeBone bone_from_json(const Json& json, const JsonReader& reader) {
  lattice::LatticeBone bone;
  bone.name = reader.get<std::string>(json, "name");
  bone.frame = reader.joint(json, "frame");
  bone.start = reader.anchor(json, "start");
  bone.end = reader.anchor(json, "end");
  bone.rest_start = reader.point(json, "rest_start");
  bone.rest_end = reader.point(json, "rest_end");
  bone.chain = reader.get<std::vector<int>>(json, "chain");
  bone.soft = reader.get<bool>(json, "soft");
  bone.tip = reader.get<bool>(json, "tip");
  return bone;
}

/// Two vertices of cells at bitwise the same place: copies of limbs.
bool has_coincident_vertices(const lattice::CellComplex& complex) {
  std::vector<std::array<double, 3>> places;
  for (Eigen::Index v = 0; v < complex.points.rows(); ++v)
    places.push_back({complex.points(v, 0), complex.points(v, 1), complex.points(v, 2)});
  std::sort(places.begin(), places.end());
  return std::adjacent_find(places.begin(), places.end()) != places.end();
}

/// [value, how often] pairs, as neighbours mostly are alike.
Json run_lengths(const std::vector<int>& values) {
  Json runs = Json::array();
  for (std::size_t i = 0, j = 0; i < values.size(); i = j) {
    for (j = i; j < values.size() && values[j] == values[i];) ++j;
    runs.push_back(Json::array({values[i], j - i}));
  }
  return runs;
}

std::vector<int> from_run_lengths(const Json& runs, std::size_t expected, const JsonReader& reader) {
  std::vector<int> values;
  for (const Json& run : runs) {
    if (!run.is_array() || run.size() != 2 || !run[0].is_number_integer() || !run[1].is_number_unsigned())
      reader.fail("key 'regions': expected pairs of a number and a count");
    const auto count = run[1].get<std::uint64_t>();
    if (count > expected - values.size()) reader.fail("key 'regions': more entries than cells");
    values.insert(values.end(), count, run[0].get<int>());
  }
  if (!values.empty() && values.size() != expected) reader.fail("key 'regions': fewer entries than cells");
  return values;
}

void restore_order(const std::vector<int>& order, const JsonReader& reader,
                   std::vector<lattice::Cell>& cells) {
  if (order.empty()) return;
  std::vector<lattice::Cell> restored;
  std::vector<bool> taken(cells.size(), false);
  for (int place : order) {
    if (place < 0 || place >= static_cast<int>(cells.size()) || taken[static_cast<std::size_t>(place)])
      reader.fail("key 'cell_order': expected every cell once");
    taken[static_cast<std::size_t>(place)] = true;
    restored.push_back(cells[static_cast<std::size_t>(place)]);
  }
  if (restored.size() != cells.size()) reader.fail("key 'cell_order': expected every cell once");
  cells = std::move(restored);
}

Json copy_to_json(const lattice::CellCopy& copy, const std::vector<std::string>& names) {
  Json frames = Json::array();
  for (int frame : copy.frames) frames.push_back(names[frame]);
  return {{"cell", copy.cell}, {"place", copy.place}, {"frames", frames}};
}

lattice::CellCopy copy_from_json(const Json& json, const JsonReader& reader,
                                 const lattice::CellComplex& complex) {
  lattice::CellCopy copy;
  copy.cell = reader.get<int>(json, "cell");
  copy.place = reader.get<int>(json, "place");
  for (const int cell : {copy.cell, copy.place})
    if (cell < 0 || cell >= static_cast<int>(complex.cells.size()))
      reader.fail("key 'copies': cell " + std::to_string(cell) + " is not in 0.." +
                  std::to_string(complex.cells.size() - 1));
  for (const std::string& name : reader.get<std::vector<std::string>>(json, "frames"))
    copy.frames.push_back(reader.joint(name));
  std::sort(copy.frames.begin(), copy.frames.end());
  return copy;
}

}  // namespace

std::string lattice_to_json(const lattice::ControlLattice& lattice, const lattice::JointTree& joints,
                            const std::vector<int>& cell_order) {
  Json json;
  json["version"] = kVersion;
  json["edge_length"] = lattice.edge_length;
  json["retries"] = lattice.retries;
  json["grid"] = lattice.is_grid;
  json["bones"] = Json::array();
  for (const lattice::LatticeBone& bone : lattice.bones)
    json["bones"].push_back(bone_to_json(bone, joints.names));
  json["soft_frames"] = Json::array();
  for (const lattice::SoftFrame& frame : lattice.soft_frames)
    json["soft_frames"].push_back(
        {{"frame", joints.names[frame.frame]}, {"position", to_json(frame.position)}});
  json["copies"] = Json::array();
  for (const lattice::CellCopy& copy : lattice.copies)
    json["copies"].push_back(copy_to_json(copy, joints.names));
  json["changes"] = Json::array();
  for (const lattice::SkeletonChange& change : lattice.changes)
    json["changes"].push_back({{"joint", change.joint}, {"what", change.what}, {"reason", change.reason}});
  json["frame_of_joint"] = Json::array();
  for (std::size_t j = 0; j < lattice.frame_of_joint.size(); ++j) {
    const int frame = lattice.frame_of_joint[j];
    json["frame_of_joint"].push_back({joints.names[j], frame < 0 ? "" : joints.names[frame]});
  }
  json["coincident"] = has_coincident_vertices(lattice.complex);
  json["regions"] = run_lengths(lattice.regions);
  json["region_names"] = Json::array();
  for (const lattice::RegionName& region : lattice.region_names)
    json["region_names"].push_back(Json::array({region.number, region.name}));
  if (!cell_order.empty()) json["cell_order"] = cell_order;
  return json.dump(1, ' ', false, Json::error_handler_t::replace);
}

lattice::Coincidence lattice_from_json(const std::string& where, const std::string& text,
                                       const lattice::JointTree& joints, lattice::ControlLattice& lattice) {
  const JsonReader reader(where, joints);
  const Json json = Json::parse(text, nullptr, false);
  if (json.is_discarded()) reader.fail("is not JSON");
  const int version = reader.get<int>(json, "version");
  if (version != kVersion)
    reader.fail("version, got " + std::to_string(version) + ", expected " + std::to_string(kVersion));
  lattice.edge_length = reader.get<double>(json, "edge_length");
  lattice.retries = reader.get<int>(json, "retries");
  lattice.is_grid = reader.get<bool>(json, "grid");
  for (const Json& bone : reader.at(json, "bones")) lattice.bones.push_back(bone_from_json(bone, reader));
  for (const Json& frame : reader.at(json, "soft_frames"))
    lattice.soft_frames.push_back({reader.joint(frame, "frame"), reader.point(frame, "position")});
  for (const Json& copy : reader.at(json, "copies"))
    lattice.copies.push_back(copy_from_json(copy, reader, lattice.complex));
  for (const Json& change : reader.at(json, "changes"))
    lattice.changes.push_back({reader.get<std::string>(change, "joint"),
                               reader.get<std::string>(change, "what"),
                               reader.get<std::string>(change, "reason")});
  lattice.frame_of_joint.assign(joints.names.size(), -1);
  for (const Json& pair : reader.at(json, "frame_of_joint")) {
    if (!pair.is_array() || pair.size() != 2 || !pair[0].is_string() || !pair[1].is_string())
      reader.fail("key 'frame_of_joint': expected pairs of names");
    const std::string frame = pair[1].get<std::string>();
    lattice.frame_of_joint[reader.joint(pair[0].get<std::string>())] =
        frame.empty() ? -1 : reader.joint(frame);
  }
  lattice.regions = from_run_lengths(reader.at(json, "regions"), lattice.complex.cells.size(), reader);
  for (const Json& region : reader.at(json, "region_names")) {
    if (!region.is_array() || region.size() != 2 || !region[0].is_number_integer() || !region[1].is_string())
      reader.fail("key 'region_names': expected pairs of a number and a name");
    lattice.region_names.push_back({region[0].get<int>(), region[1].get<std::string>()});
  }
  if (json.contains("cell_order"))
    restore_order(reader.get<std::vector<int>>(json, "cell_order"), reader, lattice.complex.cells);
  return reader.get<bool>(json, "coincident") ? lattice::Coincidence::Allowed : lattice::Coincidence::Refused;
}

}  // namespace sinew::assets::detail
