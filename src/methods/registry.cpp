// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "methods/instant_scattering/ims_method.h"
#include "methods/method.h"
#include "methods/path/path_method.h"

namespace virga {
namespace {

const MethodInfo kMethods[] = {
    {"path", "volumetric path tracing with next-event estimation: the unbiased reference",
     "Novak et al. 2018, Monte Carlo methods for volumetric light transport simulation (survey)", LayerMask::all(),
     Accuracy::unbiased, kPathSettings, createPath},
    {"ims", "instant multiple scattering: virtual point lights in media, with bias compensation",
     "Engelhardt, Novak and Dachsbacher 2010, Instant multiple scattering for interactive rendering of heterogeneous "
     "participating media",
     LayerMask::all(), Accuracy::unbiased, kImsSettings, createIms},
};

}  // namespace

std::span<const MethodInfo> methodRegistry() { return kMethods; }

const MethodInfo& findMethod(std::string_view name) {
  std::vector<std::string> names;
  for (const MethodInfo& m : kMethods) {
    if (m.name == name) return m;
    names.emplace_back(m.name);
  }
  throw Error(fmt::format("unknown method \"{}\"", name),
              {{}, didYouMean(name, names), {"available: " + joined(names)}});
}

std::string_view accuracyName(Accuracy accuracy) {
  constexpr std::string_view kNames[] = {"unbiased", "consistent", "biased"};
  return kNames[static_cast<int>(accuracy)];
}

}  // namespace virga
