// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "image/image.h"
#include "methods/method.h"

namespace virga::app {

/// The picture with the dots of an overlay over it, as large as 1/200 of its width; those behind a surface are left
/// out.
Image withDots(Image picture, const Scene& scene, const Overlay& overlay);

}  // namespace virga::app
