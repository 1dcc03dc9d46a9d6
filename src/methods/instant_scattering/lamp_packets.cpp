// SPDX-License-Identifier: Apache-2.0
#include "methods/instant_scattering/lamp_packets.h"

namespace virga {
namespace {

/// A surface that is nearer to an area lamp than this many of its edges (roots of its area) is lit by solid angle
/// instead.
constexpr float kNearLamp = 2;

Rgb intensityOf(const LampPoint& lamp) { return {lamp.r, lamp.g, lamp.b}; }
Vec3 placeOf(const LampPoint& lamp) { return {lamp.px, lamp.py, lamp.pz}; }

void set(KernelPlaces& places, int i, Vec3 p) { places.px[i] = p.x, places.py[i] = p.y, places.pz[i] = p.z; }

/// A diffuse surface as kernels take it, both normals toward the eye.
void set(KernelSurfaces& s, int i, const MarchedEye& eye) {
  set(s, i, eye.point.p);
  const Vec3 n = eye.side.frame.n, g = eye.side.normal;
  s.nx[i] = n.x, s.ny[i] = n.y, s.nz[i] = n.z;
  s.gx[i] = g.x, s.gy[i] = g.y, s.gz[i] = g.z;
  s.epsilon[i] = eye.point.epsilon;
}

void set(FogRays& fog, int i, const MarchedEye& eye, const MediumView& medium) {
  const Ray& ray = eye.at.ray;
  fog.ox[i] = ray.o.x, fog.oy[i] = ray.o.y, fog.oz[i] = ray.o.z;
  fog.dx[i] = ray.d.x, fog.dy[i] = ray.d.y, fog.dz[i] = ray.d.z;
  fog.t0[i] = eye.step[0].t0, fog.t1[i] = eye.step[0].t1;
  for (int c = 0; c < 3; ++c) fog.sigmaT[c][i] = medium.spectrum[c] * medium.sigmaT;
  const auto* hg = medium.phase.get<HenyeyGreenstein>();
  fog.anisotropy[i] = hg ? hg->g : 0;
  fog.medium[i] = eye.media[0].medium(0);
}

KernelReceivers receivers(const KernelPlaces& at) {
  return {RayPacket::kSize, at.px, at.py, at.pz, nullptr, nullptr, nullptr, nullptr, nullptr, nullptr, nullptr};
}

Ray rayOf(const RayPacket& rays, int i) {
  return {{rays.ox[i], rays.oy[i], rays.oz[i]}, {rays.dx[i], rays.dy[i], rays.dz[i]}};
}

}  // namespace

void LampPackets::add(std::span<const MarchedEye> eyes, const EyePacket& smoke,
                      std::span<LayerRadiance> radiance) const {
  for (size_t i = 0; i < eyes.size(); ++i)
    if (eyes[i].plain) marched_.addEmission(eyes[i], radiance[i]);
  lightSurfaces(eyes, radiance);
  lightFog(eyes, radiance);
  if (!smoke.empty()) lightSmoke(eyes, smoke, radiance);
  lightMedia(eyes, radiance);
}

bool LampPackets::isFog(const MarchedEye& eye) const {
  if (!eye.plain || eye.stretches != 1 || eye.steps != 1 || eye.media[0].count() != 1) return false;
  const MediumView& medium = scene_.media[eye.media[0].medium(0)];
  return medium.homogeneous && !medium.albedoGrid.values && medium.phaseBlends.size == 0 &&
         (medium.phase.get<Isotropic>() || medium.phase.get<HenyeyGreenstein>());
}

bool LampPackets::isLitByPackets(const MarchedEye& eye) const {
  if (!lamps_.alone() || eye.side.bsdf->kind() != Bsdf::Kind::diffuse) return false;
  for (const LampPoint& lamp : lamps_.points())
    if (lengthSquared(placeOf(lamp) - eye.point.p) < square(kNearLamp) * lamp.area) return false;
  return true;
}

template <class MediaRayOf>
LampPackets::Seen LampPackets::see(int lamp, const KernelPlaces& places, const RayPacket& rays,
                                   const MediaRayOf& mediaRay) const {
  Seen seen;
  const uint32_t hidden = rays_.surfaces.occluded(rays);
  const auto counts = [&](int i) { return rays.tMax[i] > 0 && !(hidden >> i & 1u); };
  if (lamps_.marches()) {
    for (int i = 0; i < kSize; ++i) {
      const Rgb own = counts(i) ? marchedTransmittance(scene_, rays_, mediaRay(i), rays.tMax[i],
                                                       MarchedLight<EmbreeRays>::kLightSteps, numbers_.shift())
                                : Rgb(1.f);
      for (int c = 0; c < 3; ++c) seen.channel[c][i] = own[c];
    }
  } else {
    float* out[3] = {seen.channel[0], seen.channel[1], seen.channel[2]};
    lamps_.look(lamp, receivers(places), out);
    for (int c = 1; c < 3; ++c)
      if (out[c] == out[0]) std::copy_n(seen.channel[0], kSize, seen.channel[c]);
  }
  for (int i = 0; i < kSize; ++i)
    if (hidden >> i & 1u)
      for (auto& channel : seen.channel) channel[i] = 0;
  return seen;
}

void LampPackets::lightSurfaces(std::span<const MarchedEye> eyes, std::span<LayerRadiance> radiance) const {
  KernelSurfaces surfaces{};
  Rgb reflected[kSize];
  std::fill_n(surfaces.epsilon, kSize, -1.f);
  bool any = false;
  for (size_t i = 0; i < eyes.size(); ++i) {
    const MarchedEye& eye = eyes[i];
    if (!eye.plain || !eye.hit.found()) continue;
    if (!isLitByPackets(eye)) {
      marched_.lightSurface(eye, radiance[i], numbers_);
      continue;
    }
    const Rgb bsdf = eye.side.wo.z > 0 ? eye.side.bsdf->value(eye.side.wo, Vec3(0, 0, 1)) : Rgb();
    if (isBlack(bsdf) || eye.side.leaks(-eye.at.ray.d, eye.side.wo)) continue;
    set(surfaces, static_cast<int>(i), eye);
    reflected[i] = bsdf * transmittanceOf(eye.depth);
    any = true;
  }
  const std::span<const LampPoint> points = lamps_.points();
  for (size_t k = 0; any && k < points.size(); ++k) {
    const LampPoint& lamp = points[k];
    if (!lamp.known) continue;
    alignas(64) Lanes value;
    RayPacket rays;
    virga::lightSurfaces(lamp, surfaces, scene_.scale, value, rays);
    const Seen seen = see(static_cast<int>(k), surfaces, rays, [&](int i) {
      const MarchedEye& eye = eyes[static_cast<size_t>(i)];
      MediaRay leaving = leaveSurface(scene_, eye.point, -eye.at.ray.d, rayOf(rays, i).d, eye.at.media);
      leaving.ray = rayOf(rays, i);
      return leaving;
    });
    for (size_t i = 0; i < eyes.size(); ++i)
      if (value[i] > 0)
        radiance[i].add(Layer::directSurface,
                        reflected[i] * intensityOf(lamp) *
                            (Rgb(seen.channel[0][i], seen.channel[1][i], seen.channel[2][i]) * value[i]));
  }
}

void LampPackets::lightFog(std::span<const MarchedEye> eyes, std::span<LayerRadiance> radiance) const {
  FogRays fog{};
  Rgb albedo[kSize];
  bool any = false;
  for (size_t i = 0; i < eyes.size(); ++i) {
    if (!isFog(eyes[i])) continue;
    const MediumView& medium = scene_.media[eyes[i].media[0].medium(0)];
    set(fog, static_cast<int>(i), eyes[i], medium);
    albedo[i] = medium.albedo;
    any = true;
    if (!lamps_.alone())
      marched_.lightMedia(eyes[i], MarchedLight<EmbreeRays>::MediaLamps::atInfinity, radiance[i], numbers_);
  }
  const int places = any ? lamps_.fogPlaces() : 0;
  for (int n = 0; n < places; ++n)
    lamps_.visitTurns(n, places, [&](const FrameLamps::Turn& turn) {
      const LampPoint& lamp = lamps_.points()[static_cast<size_t>(turn.point)];
      alignas(64) float value[3][kSize];
      KernelPlaces at;
      RayPacket rays;
      virga::lightFog(lamp, fog, along(n, places), scene_.scale, at, value, rays);
      const Seen seen = see(turn.point, at, rays, [&](int i) {
        return MediaRay{rayOf(rays, i), eyes[static_cast<size_t>(i)].media[0], 0};
      });
      for (size_t i = 0; i < eyes.size(); ++i) {
        if (!(fog.t1[i] > fog.t0[i])) continue;
        Rgb found = albedo[i] * intensityOf(lamp) * turn.share;
        for (int c = 0; c < 3; ++c) found[c] *= value[c][i] * seen.channel[c][i];
        radiance[i].add(Layer::directMedia, found);
      }
    });
}

void LampPackets::lightSmoke(std::span<const MarchedEye> eyes, const EyePacket& smoke,
                             std::span<LayerRadiance> radiance) const {
  const KernelEyes& e = smoke.eyes();
  if (e.from > e.to) return;
  const auto* hg = smoke.medium().phase.get<HenyeyGreenstein>();
  alignas(64) float sum[3][kSize] = {};
  const int places = lamps_.places();
  for (int n = 0; n < places; ++n) {
    EyePoints at;
    alignas(64) Lanes place;
    std::fill_n(place, kSize, along(n, places));
    placePoints(e, smoke.depths(), place, at);
    lamps_.visitTurns(n, places, [&](const FrameLamps::Turn& turn) {
      const LampPoint& lamp = lamps_.points()[static_cast<size_t>(turn.point)];
      alignas(64) Lanes value;
      RayPacket rays;
      lightEyes(lamp, e, at, hg ? hg->g : 0, scene_.scale, value, rays);
      const Seen seen = see(turn.point, at, rays, [&](int i) { return MediaRay{rayOf(rays, i), {}, 0}; });
      const Rgb intensity = intensityOf(lamp) * turn.share;
      for (int c = 0; c < 3; ++c)
        for (int i = 0; i < kSize; ++i) sum[c][i] += at.weight[c][i] * value[i] * seen.channel[c][i] * intensity[c];
    });
  }
  for (size_t i = 0; i < eyes.size(); ++i)
    if (eyes[i].plain && smoke.has(i))
      radiance[i].add(Layer::directMedia, Rgb(sum[0][i], sum[1][i], sum[2][i]) * smoke.medium().albedo);
}

void LampPackets::lightMedia(std::span<const MarchedEye> eyes, std::span<LayerRadiance> radiance) const {
  MediaPlaces at[FixedNumbers::kMostPlaces] = {};
  const int places = lamps_.places();
  bool any = false;
  for (size_t i = 0; i < eyes.size(); ++i) {
    if (!eyes[i].plain || eyes[i].steps == 0 || isFog(eyes[i])) continue;
    if (!lamps_.alone()) {
      marched_.lightMedia(eyes[i], MarchedLight<EmbreeRays>::MediaLamps::all, radiance[i], numbers_);
      continue;
    }
    eyes[i].visitPoints(places, numbers_.shift(), [&](int n, Vec3 p, Rgb weight, const MediaState& media) {
      set(at[n], static_cast<int>(i), p);
      at[n].weight[i] = weight, at[n].media[i] = &media;
      any = true;
    });
  }
  for (int n = 0; any && n < places; ++n)
    lamps_.visitTurns(n, places, [&](const FrameLamps::Turn& turn) { lightMedia(turn, eyes, at[n], radiance); });
}

void LampPackets::lightMedia(const FrameLamps::Turn& turn, std::span<const MarchedEye> eyes, const MediaPlaces& at,
                             std::span<LayerRadiance> radiance) const {
  const LampPoint& lamp = lamps_.points()[static_cast<size_t>(turn.point)];
  alignas(64) Lanes value;
  RayPacket rays;
  virga::lightMedia(lamp, at, scene_.scale, value, rays);
  for (size_t i = 0; i < kSize; ++i)
    if (!at.media[i]) value[i] = rays.tMax[i] = 0;
  const Seen seen = see(turn.point, at, rays, [&](int i) { return MediaRay{rayOf(rays, i), *at.media[i], 0}; });
  for (size_t i = 0; i < eyes.size(); ++i) {
    if (!(value[i] > 0)) continue;
    const Ray ray = rayOf(rays, static_cast<int>(i));
    const Rgb scattered = marched_.scatteringAt(ray.o, -eyes[i].at.ray.d, ray.d, *at.media[i]);
    radiance[i].add(Layer::directMedia,
                    at.weight[i] * scattered * intensityOf(lamp) *
                        (Rgb(seen.channel[0][i], seen.channel[1][i], seen.channel[2][i]) * (value[i] * turn.share)));
  }
}

}  // namespace virga
