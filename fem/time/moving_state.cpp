#include "fem/time/moving_state.h"

#include <bit>
#include <cstring>
#include <stdexcept>
#include <type_traits>

namespace sinew::fem {
namespace {

using lattice::Points;

static_assert(std::endian::native == std::endian::little, "bytes of a state are little-endian");

constexpr std::string_view kHeader = "sinew moving state 1\n";
/// More rows or items than any run has; what lies above is no count.
constexpr std::int64_t kMostItems = std::int64_t{1} << 32;

// The description: every part of a state, once, in an order that stays. A visitor has
//   number(name, x)          a double, a bool or a whole number;
//   leaf(name, points)       values of the leaf vertices, of any number of rows;
//   matrix(name, m)          an Eigen matrix of fixed size;
//   count(name, list)        the number of items of a list or optional, which it may change.
// `S`, `P` and so on are the types or their const versions.

template <class V, class O, class Describe>
void describe_optional(V& v, const std::string& name, O& optional, const Describe& describe) {
  v.count(name, optional);
  if (optional) describe(*optional);
}

template <class V, class L, class Describe>
void describe_list(V& v, const std::string& name, L& list, const Describe& describe) {
  v.count(name, list);
  for (std::size_t k = 0; k < list.size(); ++k) describe(name + "[" + std::to_string(k) + "]", list[k]);
}

template <class V, class P>
void describe_pose(V& v, const std::string& name, P& pose) {
  v.number(name + ".time", pose.time);
  describe_list(v, name + ".joints", pose.joints,
                [&](const std::string& item, auto& joint) { v.matrix(item, joint.matrix()); });
  describe_list(v, name + ".frames", pose.frames, [&](const std::string& item, auto& frame) {
    v.matrix(item + ".from_rest", frame.from_rest.matrix());
    v.matrix(item + ".to_rest", frame.to_rest.matrix());
    v.matrix(item + ".rotation", frame.rotation);
  });
}

template <class V, class F>
void describe_flesh(V& v, const std::string& name, F& flesh) {
  v.number(name + ".time", flesh.time);
  v.leaf(name + ".x", flesh.x);
  v.leaf(name + ".v", flesh.v);
  v.leaf(name + ".x_past", flesh.x_past);
  v.leaf(name + ".v_past", flesh.v_past);
  v.leaf(name + ".a", flesh.a);
}

template <class V, class S>
void describe(V& v, S& s) {
  describe_flesh(v, "flesh", s.flesh);
  describe_flesh(v, "before", s.before);
  describe_pose(v, "now", s.now);
  describe_pose(v, "past", s.past);
  v.number("has_before", s.has_before);
  v.number("last_h", s.last_h);
  describe_list(v, "track", s.track.passed(), [&](const std::string& item, auto& passed) {
    v.number(item + ".time", passed.time);
    v.leaf(item + ".x", passed.x);
    v.leaf(item + ".v", passed.v);
    v.leaf(item + ".a", passed.a);
  });
  describe_optional(v, "step_end", s.step_end, [&](auto& end) {
    v.leaf("step_end.x_middle", end.x_middle);
    describe_pose(v, "step_end.middle", end.middle);
    v.number("step_end.h", end.h);
  });
  describe_optional(v, "relative_velocity", s.relative_velocity,
                    [&](auto& velocity) { v.leaf("relative_velocity", velocity); });
  v.number("counter.start", s.counter.start);
  v.number("counter.step", s.counter.step);
  v.number("counter.longest", s.counter.longest);
  v.number("counter.whole", s.counter.whole);
  v.number("counter.part", s.counter.part);
  v.number("counter.halvings", s.counter.halvings);
  v.number("counter.since_change", s.counter.since_change);
  describe_optional(v, "energy.still", s.energy.still,
                    [&](auto& pose) { describe_pose(v, "energy.still", pose); });
  v.number("energy.cap", s.energy.cap);
  v.number("energy.taken.steps", s.energy.taken.steps);
  v.number("energy.taken.energy", s.energy.taken.energy);
  describe_list(v, "model", s.model.systems, [&](const std::string& item, auto& system) {
    v.number(item + ".inertia", system.inertia);
    v.number(item + ".damping", system.damping);
    describe_list(v, item + ".rotations", system.rotations,
                  [&](const std::string& cell, auto& rotation) { v.matrix(cell, rotation); });
  });
}

/// A number as eight bytes, whatever its type.
template <class T>
auto widened(T x) {
  if constexpr (std::is_floating_point_v<T>) {
    return x;
  } else {
    return static_cast<std::int64_t>(x);
  }
}

template <class T>
std::int64_t items_of(const std::optional<T>& optional) {
  return optional ? 1 : 0;
}
template <class T>
std::int64_t items_of(const std::vector<T>& list) {
  return static_cast<std::int64_t>(list.size());
}

/// Appends every part; with a list of where each begins it serves comparisons, too.
class Writer {
 public:
  std::string bytes;

  template <class T>
  void number(const std::string&, const T& x) {
    append(widened(x));
  }
  void leaf(const std::string&, const Points& points) {
    append(static_cast<std::int64_t>(points.rows()));
    append_numbers(points.data(), points.size());
  }
  template <class M>
  void matrix(const std::string&, const M& m) {
    append_numbers(m.data(), m.size());
  }
  template <class L>
  void count(const std::string&, const L& list) {
    append(items_of(list));
  }

 private:
  template <class T>
  void append(T x) {
    bytes.append(reinterpret_cast<const char*>(&x), sizeof x);
  }
  void append_numbers(const double* data, Eigen::Index n) {
    bytes.append(reinterpret_cast<const char*>(data), static_cast<std::size_t>(n) * sizeof(double));
  }
};

class Reader {
 public:
  explicit Reader(std::string_view bytes) : left_(bytes) {}

  template <class T>
  void number(const std::string& name, T& x) {
    decltype(widened(x)) wide{};
    take(name, &wide, sizeof wide);
    x = static_cast<T>(wide);
  }
  void leaf(const std::string& name, Points& points) {
    points.resize(items(name, 3 * sizeof(double)), 3);
    take(name, points.data(), static_cast<std::size_t>(points.size()) * sizeof(double));
  }
  template <class M>
  void matrix(const std::string& name, M& m) {
    take(name, m.data(), static_cast<std::size_t>(m.size()) * sizeof(double));
  }
  template <class T>
  void count(const std::string& name, std::optional<T>& optional) {
    const std::int64_t n = items(name, 0);
    if (n > 1) refuse(name);
    optional.reset();
    if (n == 1) optional.emplace();
  }
  template <class T>
  void count(const std::string& name, std::vector<T>& list) {
    list.assign(static_cast<std::size_t>(items(name, sizeof(double))), T{});
  }
  bool at_end() const { return left_.empty(); }

 private:
  [[noreturn]] static void refuse(const std::string& name) {
    throw std::invalid_argument("moving state: " + name +
                                ": the bytes end there or hold a count that cannot be; expected the bytes "
                                "of to_bytes, whole");
  }
  /// A count of items that take `least` bytes each.
  Eigen::Index items(const std::string& name, std::size_t least) {
    std::int64_t n = 0;
    take(name, &n, sizeof n);
    if (n < 0 || n > kMostItems || static_cast<std::size_t>(n) * least > left_.size()) refuse(name);
    return static_cast<Eigen::Index>(n);
  }
  void take(const std::string& name, void* to, std::size_t n) {
    if (n > left_.size()) refuse(name);
    if (n > 0) std::memcpy(to, left_.data(), n);
    left_.remove_prefix(n);
  }

  std::string_view left_;
};

/// Each part's name and bytes.
class Lister {
 public:
  std::vector<std::pair<std::string, std::string>> parts;

  template <class T>
  void number(const std::string& name, const T& x) {
    add(name, [&](Writer& w) { w.number(name, x); });
  }
  void leaf(const std::string& name, const Points& points) {
    add(name, [&](Writer& w) { w.leaf(name, points); });
  }
  template <class M>
  void matrix(const std::string& name, const M& m) {
    add(name, [&](Writer& w) { w.matrix(name, m); });
  }
  template <class L>
  void count(const std::string& name, const L& list) {
    add(name, [&](Writer& w) { w.count(name, list); });
  }

 private:
  template <class Write>
  void add(const std::string& name, const Write& write) {
    Writer writer;
    write(writer);
    parts.emplace_back(name, std::move(writer.bytes));
  }
};

/// Takes leaf values to another mesh and leaves everything else.
class Carrier {
 public:
  Carrier(const lattice::Hierarchy& hierarchy, const lattice::LeafMesh& from, const lattice::LeafMesh& to)
      : hierarchy_(hierarchy), from_(from), to_(to) {}

  template <class T>
  void number(const std::string&, T&) {}
  void leaf(const std::string&, Points& points) {
    if (points.rows() > 0) points = lattice::carried_values(hierarchy_, from_, to_, points);
  }
  template <class M>
  void matrix(const std::string&, M&) {}
  template <class L>
  void count(const std::string&, L&) {}

 private:
  const lattice::Hierarchy& hierarchy_;
  const lattice::LeafMesh &from_, &to_;
};

}  // namespace

std::string to_bytes(const MovingState& state) {
  Writer writer;
  writer.bytes = kHeader;
  describe(writer, state);
  return std::move(writer.bytes);
}

MovingState moving_state_from_bytes(std::string_view bytes) {
  if (!bytes.starts_with(kHeader))
    throw std::invalid_argument("moving state: its header is not that of version 1");
  Reader reader(bytes.substr(kHeader.size()));
  MovingState state;
  describe(reader, state);
  if (!reader.at_end()) throw std::invalid_argument("moving state: bytes are left over after its last part");
  return state;
}

std::uint64_t hash(const MovingState& state) {
  std::uint64_t hash = 0xcbf29ce484222325ULL;
  for (const char c : to_bytes(state)) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3ULL;
  return hash;
}

std::string first_difference(const MovingState& a, const MovingState& b) {
  Lister of_a, of_b;
  describe(of_a, a);
  describe(of_b, b);
  for (std::size_t k = 0; k < of_a.parts.size(); ++k)
    if (k >= of_b.parts.size() || of_a.parts[k] != of_b.parts[k]) return of_a.parts[k].first;
  return {};
}

MovingState carried_over(const MovingState& state, const lattice::Hierarchy& hierarchy,
                         const lattice::LeafMesh& from, const lattice::LeafMesh& to) {
  MovingState carried = state;
  carried.model = {};
  carried.energy.still.reset();
  Carrier carrier(hierarchy, from, to);
  describe(carrier, carried);
  return carried;
}

}  // namespace sinew::fem
