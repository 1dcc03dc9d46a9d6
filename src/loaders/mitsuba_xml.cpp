// SPDX-License-Identifier: Apache-2.0
#include "loaders/mitsuba_xml.h"

#include <fmt/format.h>

#include <algorithm>

#include "loaders/error_at.h"
#include "loaders/mitsuba_dialect.h"
#include "loaders/node_drafts.h"
#include "loaders/xml_attributes.h"
#include "loaders/xml_transform.h"
#include "loaders/xml_values.h"

namespace virga {
namespace {

namespace fs = std::filesystem;

const std::vector<std::string> kObjectTags{"integrator", "sensor",  "sampler", "film",   "rfilter", "shape",
                                           "bsdf",       "emitter", "phase",   "medium", "volume",  "texture"};
const std::vector<std::string> kValueTags{"float", "integer", "boolean", "string",
                                          "point", "vector",  "rgb",     "spectrum"};
const std::vector<std::string> kOtherTags{"transform", "animation", "ref", "default", "include", "path", "alias"};

constexpr size_t kMaxIncludes = 1000;

// Never throws: a path that cannot be resolved stays as it is, and opening it fails with a better message.
fs::path identity(const fs::path& path) {
  std::error_code error;
  const fs::path canonical = fs::weakly_canonical(path, error);
  return error ? path.lexically_normal() : canonical;
}

// Without the slash that "." and "folder/" leave behind, so that equal folders compare equal.
fs::path folderIn(const fs::path& base, const fs::path& folder) {
  const fs::path normal = (base / folder).lexically_normal();
  return normal.has_filename() ? normal : normal.parent_path();
}

bool contains(const std::vector<std::string>& words, const std::string& word) {
  return std::find(words.begin(), words.end(), word) != words.end();
}

std::vector<std::string> knownTags() {
  std::vector<std::string> all = kObjectTags;
  all.insert(all.end(), kValueTags.begin(), kValueTags.end());
  all.insert(all.end(), kOtherTags.begin(), kOtherTags.end());
  return all;
}

class Loader {
 public:
  explicit Loader(const LoadOptions& options)
      : variables_(options.defines, options.frame), complaints_(options.lenient, options.warnings) {}

  SceneDescription load(const std::shared_ptr<const SourceFile>& file, const fs::path& directory) {
    sceneDirectory_ = folderIn(fs::current_path(), directory);
    xml::Element root = xml::parse(file);
    if (root.name != "scene")
      throw errorAt(root.position, fmt::format("the root element is {}", tagOf(root)),
                    "a scene starts with <scene version=\"3.0.0\">");
    const Attributes attributes = read(root, {"version", "id"});
    if (!attributes.find("version"))
      throw errorAt(root.position, "<scene> needs the attribute \"version\"", "write <scene version=\"3.0.0\">");
    const FileContext context{sceneDirectory_, dialectOf(*attributes.find("version"))};
    if (context.dialect == Dialect::camelCase) modernise(root);

    NodeDraft& scene = addNode(root, attributes);
    readChildren(scene, root, context, 1);
    NodePtr resolved = drafts_.resolve(scene);
    variables_.requireFrameUsed(root.position);
    variables_.requireAllUsed();
    for (const Error& unused : variables_.unusedDefaults()) complaints_.warn(unused);
    return {std::move(resolved), searchPaths(), sources_};
  }

  /// The file that includes must be refused where one of its includes names it again.
  void enter(const fs::path& file) {
    openFiles_.push_back(identity(file));
    sources_.push_back(openFiles_.back());
  }

 private:
  struct FileContext {
    fs::path directory;
    Dialect dialect;
  };

  Attributes read(const xml::Element& element, const std::vector<std::string>& known) {
    return Attributes(element, known, variables_, complaints_);
  }

  NodeDraft& addNode(const xml::Element& element, const Attributes& attributes) {
    Node node{.tag = element.name, .position = element.position};
    if (element.name != "scene") {
      const Argument& type = attributes.required("type");
      if (type.text.empty()) type.fail(fmt::format("the type of a {} must not be empty", element.name));
      node.type = type.text, node.typePosition = type.position;
    }
    NodeDraft& draft = drafts_.add(std::move(node));
    if (const Argument* id = attributes.find("id")) drafts_.defineId(id->text, draft, id->position);
    return draft;
  }

  // Adds a property to the parent. `name` may be null for children, which need none.
  Property& addProperty(NodeDraft& parent, const xml::Element& element, const Argument* name) {
    Property property{.name = name ? name->text : "", .position = name ? name->position : element.position};
    property.valuePosition = element.position;
    if (name && name->text.empty()) name->fail("a name must not be empty");
    for (const Property& other : parent.node.properties) {
      if (!name || other.name != name->text) continue;
      throw errorAt(name->position, fmt::format("\"{}\" is given twice", name->text), "",
                    {fmt::format("first given at {}:{}:{}", other.position.file->name, other.position.line(),
                                 other.position.column())});
    }
    parent.node.properties.push_back(std::move(property));
    return parent.node.properties.back();
  }

  void readChildren(NodeDraft& parent, const xml::Element& element, const FileContext& context, int depth) {
    if (depth > xml::kMaxDepth)
      throw errorAt(element.position, fmt::format("more than {} elements inside each other", xml::kMaxDepth));
    for (const xml::Element& child : element.children) readChild(parent, child, context, depth);
  }

  void readChild(NodeDraft& parent, const xml::Element& element, const FileContext& context, int depth) {
    if (contains(kObjectTags, element.name)) return readObject(parent, element, context, depth);
    if (element.name == "include") return readInclude(parent, element, context, depth);
    if (element.name == "scene") throw errorAt(element.position, "a <scene> cannot stand inside another element");
    if (!contains(knownTags(), element.name)) return refuseElement(element);
    if (element.name == "transform") return readPose(parent, element, parseTransform);
    if (element.name == "animation") return readPose(parent, element, parseAnimation);
    requireNoChildren(element);
    if (contains(kValueTags, element.name)) return readValue(parent, element);
    if (element.name == "ref") return readReference(parent, element);
    if (element.name == "default") return readDefault(element);
    if (parent.node.tag != "scene")
      throw errorAt(element.position, fmt::format("{} belongs directly into the scene", tagOf(element)));
    if (element.name == "path") return readPath(element, context);
    readAlias(element);
  }

  void refuseElement(const xml::Element& element) const {
    complaints_.unknown(errorAt(element.position, fmt::format("unknown element {}", tagOf(element)),
                                didYouMean(element.name, knownTags()), {"available: " + joined(knownTags())}));
  }

  void readObject(NodeDraft& parent, const xml::Element& element, const FileContext& context, int depth) {
    const Attributes attributes = read(element, {"type", "name", "id"});
    NodeDraft& draft = addNode(element, attributes);
    addProperty(parent, element, attributes.find("name"));
    parent.links.push_back({.property = parent.node.properties.size() - 1, .child = &draft, .id = draft.node.id});
    readChildren(draft, element, context, depth + 1);
  }

  void readReference(NodeDraft& parent, const xml::Element& element) {
    const Attributes attributes = read(element, {"id", "name"});
    const Argument& id = attributes.required("id");
    addProperty(parent, element, attributes.find("name")).valuePosition = id.position;
    parent.links.push_back({.property = parent.node.properties.size() - 1, .id = id.text, .notes = id.notes});
  }

  // An animation is the pose that it has at the frame to be rendered: a description is that of one frame.
  void readPose(NodeDraft& parent, const xml::Element& element,
                Matrix4 (*parse)(const xml::Element&, Variables&, const Complaints&)) {
    const Attributes attributes = read(element, {"name"});
    const Matrix4 matrix = parse(element, variables_, complaints_);
    addProperty(parent, element, &attributes.required("name")).value = matrix;
  }

  static void refuseSpectrumPlugin(const xml::Element& element) {
    for (const xml::Attribute& attribute : element.attributes)
      if (element.name == "spectrum" && (attribute.name == "type" || attribute.name == "filename"))
        throw errorAt(attribute.namePosition, "spectra from plugins or files are not supported",
                      "write <rgb name=\"...\" value=\"r, g, b\"/>");
  }

  void readValue(NodeDraft& parent, const xml::Element& element) {
    refuseSpectrumPlugin(element);
    const bool isVector = element.name == "point" || element.name == "vector";
    const auto known =
        isVector ? std::vector<std::string>{"name", "value", "x", "y", "z"} : std::vector<std::string>{"name", "value"};
    const Attributes attributes = read(element, known);
    Property& property = addProperty(parent, element, &attributes.required("name"));
    if (isVector && !attributes.find("value")) {
      property.value = components(attributes);
      return;
    }
    if (isVector && (attributes.find("x") || attributes.find("y") || attributes.find("z")))
      throw errorAt(element.position, fmt::format("{} has both \"value\" and \"x\", \"y\" or \"z\"", tagOf(element)));
    const Argument& value = attributes.required("value");
    property.valuePosition = value.position;
    property.value = parseValue(element.name, value);
  }

  static Vec3 components(const Attributes& attributes) {
    Vec3 out;
    for (int i = 0; i < 3; ++i) {
      const Argument& component = attributes.required(std::string_view("xyz").substr(static_cast<size_t>(i), 1));
      const double number = parseNumber(component);
      out[i] = toVec3({number, number, number}, component).x;
    }
    return out;
  }

  static Value parseValue(const std::string& tag, const Argument& value) {
    if (tag == "float") return parseNumber(value);
    if (tag == "integer") return parseInteger(value);
    if (tag == "boolean") return parseBoolean(value);
    if (tag == "rgb") return parseRgb(value);
    if (tag == "spectrum") return parseSpectrum(value);
    if (tag == "string") return value.text;
    return toVec3(parseTriple(value), value);
  }

  void readDefault(const xml::Element& element) {
    const Attributes attributes = read(element, {"name", "value"});
    const Argument& name = attributes.required("name");
    if (name.text.empty()) name.fail("a name must not be empty");
    variables_.addDefault(name.text, attributes.required("value").text, name.position);
  }

  void readAlias(const xml::Element& element) {
    const Attributes attributes = read(element, {"id", "as"});
    const Argument &id = attributes.required("id"), &as = attributes.required("as");
    drafts_.defineAlias(id.text, as.text, id.position, as.position);
  }

  void readPath(const xml::Element& element, const FileContext& context) {
    const Attributes attributes = read(element, {"value"});
    const Argument& value = attributes.required("value");
    const fs::path path = folderIn(context.directory, value.text);
    std::error_code error;
    if (!fs::is_directory(path, error))
      complaints_.unknown(
          errorAt(value.position, fmt::format("there is no folder \"{}\"", path.string()), "", value.notes));
    paths_.insert(paths_.begin(), path);
  }

  void readInclude(NodeDraft& parent, const xml::Element& element, const FileContext& context, int depth) {
    requireNoChildren(element);
    const Attributes attributes = read(element, {"filename"});
    const Argument& filename = attributes.required("filename");
    const fs::path path = findInclude(filename, context);
    if (++includes_ > kMaxIncludes) filename.fail(fmt::format("more than {} included files", kMaxIncludes));
    requireNotOpen(filename, path);
    enter(path);
    readIncluded(parent, filename, path, context, depth);
    openFiles_.pop_back();
  }

  void readIncluded(NodeDraft& parent, const Argument& filename, const fs::path& path, const FileContext& includer,
                    int depth) {
    std::shared_ptr<const SourceFile> file;
    try {
      file = xml::readFile(path);
    } catch (const Error& error) {
      throw error.at(filename.position);
    }
    xml::Element root = xml::parse(file);
    FileContext context{path.parent_path(), includer.dialect};
    takeVersion(root, context);
    if (root.name == "scene") read(root, {"id"});  // nothing to take from it, but the attributes must be known ones
    // A lone object is a child like any other; the wrapper gives it the same treatment.
    if (root.name != "scene") root = {.name = "scene", .position = root.position, .attributes = {}, .children = {root}};
    if (context.dialect == Dialect::camelCase) modernise(root);
    includeDirectories_.push_back(context.directory);
    readChildren(parent, root, context, depth + 1);
  }

  // The root of an included file may have a version of its own; else that of the including file holds.
  void takeVersion(xml::Element& root, FileContext& context) {
    const auto isVersion = [](const xml::Attribute& a) { return a.name == "version"; };
    const auto version = std::find_if(root.attributes.begin(), root.attributes.end(), isVersion);
    if (version == root.attributes.end()) return;
    context.dialect = dialectOf(variables_.substituted(*version));
    root.attributes.erase(version);
  }

  fs::path findInclude(const Argument& filename, const FileContext& context) const {
    std::vector<fs::path> directories{context.directory};
    directories.insert(directories.end(), paths_.begin(), paths_.end());
    if (context.directory != sceneDirectory_) directories.push_back(sceneDirectory_);
    for (const fs::path& directory : directories) {
      const fs::path path = (directory / filename.text).lexically_normal();
      std::error_code error;
      if (fs::exists(path, error)) return path;
    }
    Error::Details details{.position = filename.position, .hint = {}, .notes = filename.notes};
    for (const fs::path& directory : directories) details.notes.push_back("looked in " + directory.string());
    throw Error(fmt::format("there is no file \"{}\"", filename.text), std::move(details));
  }

  void requireNotOpen(const Argument& filename, const fs::path& path) const {
    const auto open = std::find(openFiles_.begin(), openFiles_.end(), identity(path));
    if (open == openFiles_.end()) return;
    std::string chain;
    for (auto file = open; file != openFiles_.end(); ++file) chain += file->filename().string() + " includes ";
    throw errorAt(filename.position, fmt::format("the file \"{}\" includes itself", filename.text), "",
                  {chain + open->filename().string()});
  }

  std::vector<fs::path> searchPaths() const {
    std::vector<fs::path> all = paths_;
    all.push_back(sceneDirectory_);
    all.insert(all.end(), includeDirectories_.begin(), includeDirectories_.end());
    std::vector<fs::path> unique;
    for (const fs::path& path : all)
      if (std::find(unique.begin(), unique.end(), path) == unique.end()) unique.push_back(path);
    return unique;
  }

  Variables variables_;
  Complaints complaints_;
  NodeDrafts drafts_;
  fs::path sceneDirectory_;
  std::vector<fs::path> paths_;  // from <path>, the latest first
  std::vector<fs::path> includeDirectories_;
  std::vector<fs::path> openFiles_;
  std::vector<fs::path> sources_;  // all that were ever open
  size_t includes_ = 0;
};

}  // namespace

SceneDescription loadMitsubaXml(const std::filesystem::path& file, const LoadOptions& options) {
  const std::shared_ptr<const SourceFile> text = xml::readFile(file);
  Loader loader(options);
  loader.enter(file);
  return loader.load(text, file.parent_path());
}

SceneDescription parseMitsubaXml(std::string text, std::string name, const std::filesystem::path& directory,
                                 const LoadOptions& options) {
  return Loader(options).load(std::make_shared<const SourceFile>(SourceFile{std::move(name), std::move(text)}),
                              directory);
}

}  // namespace virga
