// SPDX-License-Identifier: Apache-2.0
#include "loaders/xml_transform.h"

#include <fmt/format.h>

#include <cmath>
#include <optional>

#include "core/keyframes.h"
#include "loaders/error_at.h"
#include "loaders/xml_values.h"

namespace virga {
namespace {

using Triple = std::array<double, 3>;

const std::vector<std::string> kSteps{"translate", "rotate", "scale", "lookat", "matrix"};

// x, y, z each on its own, or all in `value`.
Triple axisValues(const xml::Element& element, const Attributes& attributes, double absent) {
  Triple out{absent, absent, absent};
  bool any = false;
  for (size_t i = 0; i < 3; ++i)
    if (const Argument* argument = attributes.find(std::string_view("xyz").substr(i, 1)))
      out[i] = parseNumber(*argument), any = true;
  if (const Argument* value = attributes.find("value")) {
    if (any)
      throw errorAt(element.position, fmt::format("{} has both \"value\" and \"x\", \"y\" or \"z\"", tagOf(element)));
    return parseTriple(*value);
  }
  if (!any)
    throw errorAt(element.position, fmt::format("{} needs \"value\", or \"x\", \"y\" and \"z\"", tagOf(element)));
  return out;
}

// Where no way is up: any direction across the line of sight (the branch-free frame of Duff et al. 2017).
Triple perpendicular(const Triple& forward) {
  const double n = std::hypot(forward[0], forward[1], forward[2]);
  const double x = forward[0] / n, y = forward[1] / n, z = forward[2] / n;
  const double sign = std::copysign(1.0, z), a = -1 / (sign + z);
  return {1 + sign * x * x * a, sign * x * y * a, -sign * x};
}

Triple point(const Argument& argument) {
  const std::vector<double> numbers = parseNumbers(argument);
  if (numbers.size() != 3) argument.fail(fmt::format("expected 3 numbers, found {}", numbers.size()));
  return {numbers[0], numbers[1], numbers[2]};
}

Matrix4 lookAt(const Attributes& attributes) {
  const Triple origin = point(attributes.required("origin")), target = point(attributes.required("target"));
  const Triple forward{target[0] - origin[0], target[1] - origin[1], target[2] - origin[2]};
  if (std::hypot(forward[0], forward[1], forward[2]) == 0)
    attributes.required("target").fail("origin and target are the same point");
  const Argument* given = attributes.find("up");
  const Matrix4 matrix = Matrix4::lookAt(origin, target, given ? point(*given) : perpendicular(forward));
  if (!matrix.isFinite() || matrix.isSingular()) {
    const Argument& blamed = given ? *given : attributes.required("target");
    blamed.fail("\"up\" must not be zero or point along the line of sight");
  }
  return matrix;
}

Matrix4 matrix(const Argument& argument) {
  const std::vector<double> n = parseNumbers(argument);
  if (n.size() != 9 && n.size() != 16) argument.fail(fmt::format("expected 9 or 16 numbers, found {}", n.size()));
  const int columns = n.size() == 9 ? 3 : 4;
  Matrix4 out;
  for (int i = 0; i < columns; ++i)
    for (int j = 0; j < columns; ++j) out(i, j) = n[static_cast<size_t>(columns * i + j)];
  if (!out.isAffine()) argument.fail("the last row of a transform must be 0 0 0 1");
  return out;
}

class TransformReader {
 public:
  TransformReader(Variables& variables, const Complaints& complaints)
      : variables_(variables), complaints_(complaints) {}

  std::optional<Matrix4> step(const xml::Element& element) {
    requireNoChildren(element);
    if (element.name == "translate") return translation(element);
    if (element.name == "scale") return scaling(element);
    if (element.name == "rotate") return rotation(element);
    if (element.name == "lookat") return lookAt(read(element, {"origin", "target", "up"}));
    if (element.name == "matrix") return matrix(read(element, {"value"}).required("value"));
    complaints_.unknown(errorAt(element.position, fmt::format("unknown transform {}", tagOf(element)),
                                didYouMean(element.name, kSteps), {"available: " + joined(kSteps)}));
    return std::nullopt;
  }

 private:
  Attributes read(const xml::Element& element, const std::vector<std::string>& known) {
    return Attributes(element, known, variables_, complaints_);
  }

  Matrix4 translation(const xml::Element& element) {
    const Triple v = axisValues(element, read(element, {"x", "y", "z", "value"}), 0);
    return Matrix4::translation(v[0], v[1], v[2]);
  }

  Matrix4 scaling(const xml::Element& element) {
    const Triple v = axisValues(element, read(element, {"x", "y", "z", "value"}), 1);
    return Matrix4::scaling(v[0], v[1], v[2]);
  }

  Matrix4 rotation(const xml::Element& element) {
    const Attributes attributes = read(element, {"x", "y", "z", "value", "angle"});
    const Triple axis = axisValues(element, attributes, 0);
    if (std::hypot(axis[0], axis[1], axis[2]) == 0)
      throw errorAt(element.position, "the axis of a rotation must not be zero");
    return Matrix4::rotation(axis[0], axis[1], axis[2], parseNumber(attributes.required("angle")));
  }

  Variables& variables_;
  const Complaints& complaints_;
};

}  // namespace

Matrix4 parseTransform(const xml::Element& transform, Variables& variables, const Complaints& complaints) {
  Matrix4 product;
  TransformReader reader(variables, complaints);
  for (const xml::Element& element : transform.children)
    if (const std::optional<Matrix4> step = reader.step(element)) product = *step * product;
  if (!product.isFinite()) throw errorAt(transform.position, "this transform overflows");
  return product;
}

Matrix4 parseAnimation(const xml::Element& animation, Variables& variables, const Complaints& complaints) {
  std::vector<Keyframe> keyframes;
  for (const xml::Element& element : animation.children) {
    if (element.name != "transform") {
      complaints.unknown(errorAt(element.position, fmt::format("{} cannot stand in an <animation>", tagOf(element)), "",
                                 {"available: transform"}));
      continue;
    }
    const Attributes attributes(element, {"time"}, variables, complaints);
    const Argument& time = attributes.required("time");
    const Keyframe key{parseNumber(time), parseTransform(element, variables, complaints)};
    if (!keyframes.empty() && key.time <= keyframes.back().time) time.fail("the times of keyframes must increase");
    if (key.pose.isSingular())
      throw errorAt(element.position, "this keyframe flattens space", "an animation needs regular transforms");
    keyframes.push_back(key);
  }
  if (keyframes.empty())
    throw errorAt(animation.position, "an <animation> needs keyframes", "<transform time=\"1\"> ... </transform>");
  const double time = variables.frame(animation.position).value_or(keyframes.front().time);
  return poseAt(keyframes, time);
}

}  // namespace virga
