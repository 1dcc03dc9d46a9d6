// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/transform.h"
#include "loaders/xml_attributes.h"

namespace virga {

/// The product of the steps below a `<transform>`: the first step acts on a point first. Affine and finite.
Matrix4 parseTransform(const xml::Element& transform, Variables& variables, const Complaints& complaints);

/// What the keyframes of an `<animation>`, `<transform time="...">`, say about the time that the variable `frame`
/// names; where there is none, the pose of the first one (core/keyframes.h).
Matrix4 parseAnimation(const xml::Element& animation, Variables& variables, const Complaints& complaints);

}  // namespace virga
