// SPDX-License-Identifier: Apache-2.0
#include "methods/rendering.h"

#include <fmt/format.h>

#include "loaders/mitsuba_xml.h"
#include "scene/builder.h"

namespace virga::testing {

SceneSnapshot sceneOf(const std::string& elements, const std::string& directory) {
  return buildScene(parseMitsubaXml("<scene version=\"3.0.0\">\n" + elements + "\n</scene>", "test.xml", directory));
}

RenderSession rendered(SceneSnapshot scene, const Run& run) {
  RenderSession session(std::move(scene), findMethod(run.method),
                        {.settings = {.values = run.settings, .seed = run.seed}, .layers = run.layers});
  for (int i = 0; i < run.passes; ++i) session.step();
  return session;
}

stats::Moments pixelMoments(const Image& image) {
  stats::Moments moments;
  for (const Rgb& p : image.pixels) moments.add(static_cast<double>(mean(p)));
  return moments;
}

stats::Moments replicateMoments(const Film& film) {
  stats::Moments moments;
  for (int r = 0; r < Film::kReplicates; ++r) moments.add(pixelMoments(film.replicateBeauty(r)).mean());
  return moments;
}

stats::Moments replicateMoments(const Film& film, Layer layer) {
  stats::Moments moments;
  for (int r = 0; r < Film::kReplicates; ++r) moments.add(pixelMoments(film.replicateLayer(r, layer)).mean());
  return moments;
}

float largestDifference(const Image& a, const Image& b) {
  float largest = 0;
  for (size_t i = 0; i < a.pixels.size(); ++i)
    for (int c = 0; c < 3; ++c) largest = std::max(largest, std::fabs(a.pixels[i][c] - b.pixels[i][c]));
  return largest;
}

std::string pinpointSensor(const std::string& origin, const std::string& target, const std::string& up, int size,
                           const std::string& extra) {
  return fmt::format(R"(<sensor type="perspective" id="camera"><float name="fov" value="0.001"/>
    <transform name="to_world"><lookat origin="{}" target="{}" up="{}"/></transform>
    <film type="hdrfilm"><integer name="width" value="{}"/><integer name="height" value="{}"/><rfilter type="box"/></film>
    {}</sensor>)",
                     origin, target, up, size, size, extra);
}

}  // namespace virga::testing
