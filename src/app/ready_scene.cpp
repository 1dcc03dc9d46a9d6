// SPDX-License-Identifier: Apache-2.0
#include "app/ready_scene.h"

#include "app/scene_source.h"

namespace virga::app {
namespace {

constexpr std::string_view kPlaceholder =
    "virga-frame-number";  // stands for the variable, which a description cannot hold

std::string sceneName(const ReadyScene& scene) {
  std::filesystem::path name = scene.nameInScene;
  if (scene.isSequence) name.replace_extension("." + std::string(kPlaceholder) + name.extension().string());
  return name.generic_string();
}

// Puts the variable, with its default, into the text.
std::string withFrameVariable(std::string xml) {
  xml.replace(xml.find(kPlaceholder), kPlaceholder.size(), "$frame");
  const size_t body = xml.find('\n', xml.find("<scene")) + 1;
  return xml.insert(body, "  <default name=\"frame\" value=\"0001\"/>\n");
}

}  // namespace

std::string readySceneXml(const ReadyScene& scene) {
  SceneDescription around = sceneAroundVolume(scene.frames, scene.thickness);
  around.searchPaths.clear();  // a scene finds what lies beside it, wherever both are moved
  const std::string xml = toXml(edited(around, "density", "filename", sceneName(scene)));
  return scene.isSequence ? withFrameVariable(xml) : xml;
}

}  // namespace virga::app
