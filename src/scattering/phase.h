// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/tagged.h"
#include "scattering/phase_functions.h"
#include "scattering/phase_table.h"

namespace virga {

/// One of several phase functions.
template <class... Phases>
class AnyPhase : public Tagged<Phases...> {
 public:
  using Tagged<Phases...>::Tagged;

  VIRGA_HD float value(Vec3 wo, Vec3 wi) const {
    return this->visit([&](const auto& p) { return p.value(wo, wi); });
  }
  VIRGA_HD float pdf(Vec3 wo, Vec3 wi) const {
    return this->visit([&](const auto& p) { return p.pdf(wo, wi); });
  }
  VIRGA_HD PhaseSample sample(Vec3 wo, Vec2 u) const {
    return this->visit([&](const auto& p) { return p.sample(wo, u); });
  }
};

/// All that are no mixtures, and More. A new phase function is a struct with value, pdf, sample and ==, and its name
/// here.
template <class... More>
using OneOfThePhases =
    AnyPhase<Isotropic, HenyeyGreenstein, CornetteShanks, Rayleigh, Schlick, TabulatedPhase, More...>;

using PlainPhase = OneOfThePhases<>;

/// Several phase functions, each with its share of the scattering. A view of the lobes, with weights of its own.
struct PhaseMixture {
  static constexpr int kMostLobes = 4;

  const PlainPhase* lobes = nullptr;
  int count = 0;
  float weights[kMostLobes] = {};  ///< >= 0; they add up to 1

  VIRGA_HD float value(Vec3 wo, Vec3 wi) const {
    float sum = 0;
    for (int i = 0; i < count; ++i) sum += weights[i] * lobes[i].value(wo, wi);
    return sum;
  }
  VIRGA_HD float pdf(Vec3 wo, Vec3 wi) const {
    float sum = 0;
    for (int i = 0; i < count; ++i) sum += weights[i] * lobes[i].pdf(wo, wi);
    return sum;
  }
  /// By one of the lobes; the same random number, stretched, goes on into it.
  VIRGA_HD PhaseSample sample(Vec3 wo, Vec2 u) const {
    int chosen = 0;
    float start = 0, sum = 0;  // the last lobe of any weight stands in for what rounding has left of it
    for (int i = 0; i < count; ++i) {
      if (weights[i] > 0 && sum <= u.x) chosen = i, start = sum;
      sum += weights[i];
    }
    u.x = std::min((u.x - start) / weights[chosen], 0x1.fffffep-1f);
    PhaseSample s = lobes[chosen].sample(wo, u);
    s.value *= weights[chosen];
    s.pdf *= weights[chosen];
    for (int i = 0; i < count; ++i) {
      if (i == chosen) continue;
      s.value += weights[i] * lobes[i].value(wo, s.wi);
      s.pdf += weights[i] * lobes[i].pdf(wo, s.wi);
    }
    return s;
  }
  friend bool operator==(const PhaseMixture&, const PhaseMixture&) = default;
};

/// Any phase function, as a tagged value.
using PhaseFunction = OneOfThePhases<PhaseMixture>;

}  // namespace virga
