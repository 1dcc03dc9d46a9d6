// SPDX-License-Identifier: Apache-2.0
#include "methods/brute_force_bsdf.h"

#include <complex>
#include <optional>

namespace virga::testing::brute {
namespace {

using Kind = Material::Kind;

Vector mirrored(Vector d, Vector n) { return d - n * (2 * dot(d, n)); }

Vector diffuseAt(const Material& m, const Hit& hit) {
  const auto firstHalf = [](double x) { return x - std::floor(x) < 0.5; };
  if (m.board.u == 0 || firstHalf(hit.u * m.board.u) == firstHalf(hit.v * m.board.v)) return m.diffuse;
  return m.board.other;
}

/// Directions by the cosine, whatever the lobe.
Vector reflectByCosine(const Hit& hit, Vector d, Vector n, Vector& throughput, Random& random) {
  const Material& m = *hit.material;
  const Vector w = around(n, std::sqrt(random()), random);
  Vector factor = diffuseAt(m, hit);
  if (m.kind == Kind::phong) {
    const double lobe = std::max(0.0, dot(mirrored(d, n), w));
    factor = factor + m.specular * ((m.exponent + 2) / 2 * std::pow(lobe, m.exponent));
  }
  throughput = throughput * factor;
  return w;
}

// --- smooth glass ---

/// Fresnel's equations at an interface, met from one side.
struct Interface {
  double ratio;            ///< of the index before to the one behind
  double cosine;           ///< of the angle of incidence
  double behind = 0;       ///< cosine of the angle of refraction
  double reflectance = 1;  ///< of light without polarisation

  Interface(double indexBefore, double indexBehind, double cosineBefore)
      : ratio(indexBefore / indexBehind), cosine(cosineBefore) {
    const double sine2 = ratio * ratio * (1 - cosine * cosine);
    if (sine2 >= 1) return;
    behind = std::sqrt(1 - sine2);
    const double s = (ratio * cosine - behind) / (ratio * cosine + behind);
    const double p = (cosine - ratio * behind) / (cosine + ratio * behind);
    reflectance = (s * s + p * p) / 2;
  }

  /// `n` is the unit normal on the side of the light.
  Vector refracted(Vector d, Vector n) const { return unit(d * ratio + n * (ratio * cosine - behind)); }
};

/// Light along d at glass, whose normal n points outside; `facet` is the normal of what it meets, on the light's side.
Interface interfaceOf(const Material& m, Vector d, Vector n, Vector facet) {
  const bool entering = dot(d, n) < 0;
  return {entering ? 1 : m.index, entering ? m.index : 1, -dot(d, facet)};
}

/// Reflects or refracts as Fresnel's equations divide the light; radiance that enters glass grows by the square of the
/// index.
Vector divide(const Interface& interface, Vector d, Vector facet, Vector& throughput, Random& random) {
  if (random() < interface.reflectance) return mirrored(d, facet);
  throughput = throughput * (interface.ratio * interface.ratio);
  return interface.refracted(d, facet);
}

Vector passGlass(const Material& m, Vector d, Vector n, Vector& throughput, Random& random) {
  const Vector side = dot(d, n) < 0 ? n : -n;
  return divide(interfaceOf(m, d, n, side), d, side, throughput, random);
}

/// Light goes to and fro between the two faces of a pane until one of them lets it out: through, or back.
bool goesThroughPane(const Material& m, double cosine, Random& random) {
  const double r = Interface(1, m.index, cosine).reflectance;
  if (random() < r) return false;
  bool far = true;
  while (random() < r) far = !far;
  return far;
}

// --- rough surfaces: Walter, Marschner, Li and Torrance 2007, "Microfacet models for refraction through rough
// surfaces"

/// A facet's normal, by the density of normals times its cosine (equations 28 and 35).
Vector sampleFacet(const Material& m, Vector n, Random& random) {
  const double u = random();
  const double tangent2 = m.alpha * m.alpha * (m.facets == Material::Facets::ggx ? u / (1 - u) : -std::log(1 - u));
  return around(n, 1 / std::sqrt(1 + tangent2), random);
}

/// Smith's shadowing of directions at an angle to the surface's normal (equations 34, and 23 in full).
double unshadowed(const Material& m, double cosine) {
  const double c2 = std::min(1.0, cosine * cosine), slope = m.alpha * std::sqrt((1 - c2) / c2);
  if (m.facets == Material::Facets::ggx) return 2 / (1 + std::sqrt(1 + slope * slope));
  if (slope == 0) return 1;
  const double a = 1 / slope;
  return 2 / (1 + std::erf(a) + std::exp(-a * a) / (a * std::sqrt(kPiExact)));
}

/// What is left of a sampled facet (equation 41).
double facetWeight(const Material& m, Vector d, Vector w, Vector facet, Vector n) {
  const double shadows = unshadowed(m, dot(d, n)) * unshadowed(m, dot(w, n));
  return std::fabs(dot(d, facet) / (dot(d, n) * dot(facet, n))) * shadows;
}

double metalReflectance(double cosine, double eta, double k) {
  const std::complex<double> index(eta, k), inside = std::sqrt(index * index - (1 - cosine * cosine));
  const std::complex<double> s = (cosine - inside) / (cosine + inside);
  const std::complex<double> p = (index * index * cosine - inside) / (index * index * cosine + inside);
  return (std::norm(s) + std::norm(p)) / 2;
}

using Direction = std::optional<Vector>;  ///< nothing: the light is lost between facets

/// n is on the side of the light.
Direction reflectRoughMetal(const Material& m, Vector d, Vector n, Vector& throughput, Random& random) {
  const Vector facet = sampleFacet(m, n, random), w = mirrored(d, facet);
  const double cosine = -dot(d, facet);
  if (cosine <= 0 || dot(w, n) <= 0) return {};
  const Vector reflectance{metalReflectance(cosine, m.eta.x, m.k.x), metalReflectance(cosine, m.eta.y, m.k.y),
                           metalReflectance(cosine, m.eta.z, m.k.z)};
  throughput = throughput * m.specular * reflectance * facetWeight(m, d, w, facet, n);
  return w;
}

/// n points outside.
Direction passRoughGlass(const Material& m, Vector d, Vector n, Vector& throughput, Random& random) {
  const Vector side = dot(d, n) < 0 ? n : -n, facet = sampleFacet(m, side, random);
  if (dot(d, facet) >= 0) return {};
  const Interface interface = interfaceOf(m, d, n, facet);
  const bool reflects = random() < interface.reflectance;
  const Vector w = reflects ? mirrored(d, facet) : interface.refracted(d, facet);
  if ((dot(w, side) > 0) != reflects) return {};
  throughput = throughput * (facetWeight(m, d, w, facet, side) * (reflects ? 1 : interface.ratio * interface.ratio));
  return w;
}

// --- what reflects alone ---

Direction reflectOpaque(const Hit& hit, Vector d, Vector& throughput, Random& random) {
  const Material& m = *hit.material;
  const bool back = dot(d, hit.normal) > 0;
  if (!black(m.emission) || (back && !m.twoSided)) return {};
  const Vector n = back ? -hit.normal : hit.normal;
  if (m.kind == Kind::roughMetal) return reflectRoughMetal(m, d, n, throughput, random);
  if (m.kind != Kind::mirror) return reflectByCosine(hit, d, n, throughput, random);
  throughput = throughput * m.specular;
  return mirrored(d, n);
}

Direction scattered(const Hit& hit, Vector d, Vector& throughput, Random& random) {
  if (hit.material->kind == Kind::glass) return passGlass(*hit.material, d, hit.normal, throughput, random);
  if (hit.material->kind == Kind::roughGlass) return passRoughGlass(*hit.material, d, hit.normal, throughput, random);
  return reflectOpaque(hit, d, throughput, random);
}

}  // namespace

Outcome reflect(const Hit& hit, Line& line, Vector& throughput, std::string& history, Random& random) {
  const Material& m = *hit.material;
  const Vector x = line.at(hit.t);
  history += m.kind == Kind::mirror || m.kind == Kind::glass || m.kind == Kind::pane ? 'p' : 's';
  if (m.kind == Kind::pane) {
    const bool through = goesThroughPane(m, std::fabs(dot(line.d, hit.normal)), random);
    line = {x, through ? line.d : mirrored(line.d, hit.normal)};
    return through ? Outcome::passed : Outcome::scattered;
  }
  const Direction w = scattered(hit, line.d, throughput, random);
  if (!w) return Outcome::absorbed;
  line = {x, *w};
  return Outcome::scattered;
}

}  // namespace virga::testing::brute
