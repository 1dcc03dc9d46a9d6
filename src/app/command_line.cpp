// SPDX-License-Identifier: Apache-2.0
#include "app/command_line.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <charconv>
#include <cmath>
#include <functional>
#include <memory>

#include "app/options.h"
#include "app/usage_error.h"
#include "core/error.h"
#include "image/image_io.h"

namespace virga::app {
namespace {

/// What the parsed command does.
using Action = std::function<int()>;

[[noreturn]] void failValue(std::string_view option, std::string_view text, std::string_view expected) {
  throw UsageError(fmt::format("{} {}: {}", option, text, expected));
}

template <class T>
std::optional<T> parsed(std::string_view text) {
  T value{};
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (code != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

double positive(std::string_view option, const std::string& text) {
  const auto value = parsed<double>(text);
  if (!value || !std::isfinite(*value) || *value <= 0) failValue(option, text, "expected a number above 0");
  return *value;
}

template <class T>
T wholeNumber(std::string_view option, const std::string& text, T lowest, T highest) {
  const auto value = parsed<T>(text);
  if (!value || *value < lowest || *value > highest)
    failValue(option, text, fmt::format("expected a whole number from {} to {}", lowest, highest));
  return *value;
}

std::pair<int, int> imageSize(const std::string& text) {
  const size_t x = text.find('x');
  const auto width = parsed<int>(std::string_view(text).substr(0, x));
  const auto height = x == std::string::npos ? std::nullopt : parsed<int>(std::string_view(text).substr(x + 1));
  if (!width || !height || *width < 1 || *height < 1) failValue("--size", text, "expected WIDTHxHEIGHT, like 640x360");
  if (*width > kMaxImageSide || *height > kMaxImageSide || int64_t{*width} * *height > kMaxImagePixels)
    failValue("--size", text,
              fmt::format("more than {} pixels, or a side of more than {}", kMaxImagePixels, kMaxImageSide));
  return {*width, *height};
}

/// An option whose text goes through `take(text)`.
template <class Take>
CLI::Option* addParsed(CLI::App& app, const std::string& names, const Take& take, const std::string& summary,
                       const std::string& placeholder) {
  const auto callback = [take](const std::string& text) { take(text); };
  return app.add_option_function<std::string>(names, callback, summary)->type_name(placeholder);
}

/// An option that takes one text each time it is given.
CLI::Option* addRepeated(CLI::App& app, const std::string& names, std::vector<std::string>& into,
                         const std::string& summary, const std::string& placeholder) {
  return app.add_option(names, into, summary)->allow_extra_args(false)->type_name(placeholder);
}

void addSceneOptions(CLI::App& app, SceneOptions& scene, const std::string& name, const std::string& summary) {
  app.add_option(name, scene.file, summary)->required()->type_name("");
  const auto define = [&scene](const std::vector<std::string>& texts) {
    for (const std::string& text : texts) {
      const size_t equals = text.find('=');
      if (equals == std::string::npos || equals == 0) failValue("-D", text, "expected name=value");
      scene.defines[text.substr(0, equals)] = text.substr(equals + 1);
    }
  };
  app.add_option_function<std::vector<std::string>>("-D,--define", define, "Value of $name in the scene; repeatable")
      ->allow_extra_args(false)
      ->type_name("name=value");
  app.add_flag("--lenient", scene.lenient, "Unknown elements and parameters of the scene are warnings, not errors");
}

FrameRange framesOf(const std::string& text) {
  const auto range = frameRange(text);
  if (!range) failValue("--frames", text, "expected FIRST..LAST, like 1..24, from 0 to 999999");
  return *range;
}

void addStopRules(CLI::App& app, StopRules& stop) {
  constexpr int64_t kMostPasses = int64_t{1} << 40;
  const char* group = "When to stop (at the first that is met; default: the scene's sample_count)";
  const auto passes = [&stop](const char* option) {
    return
        [&stop, option](const std::string& text) { stop.passes = wholeNumber<int64_t>(option, text, 1, kMostPasses); };
  };
  CLI::Option* spp = addParsed(app, "--spp", passes("--spp"), "Samples a pixel; a pass of path is one", "N");
  spp->group(group);
  addParsed(app, "--passes", passes("--passes"), "Passes of the method", "N")->group(group)->excludes(spp);
  addParsed(
      app, "--time", [&stop](const std::string& t) { stop.seconds = positive("--time", t); }, "Seconds of rendering",
      "SEC")
      ->group(group);
  addParsed(
      app, "--error", [&stop](const std::string& t) { stop.relMse = positive("--error", t); },
      "Estimated relMSE of the picture", "RELMSE")
      ->group(group);
}

Action addRender(CLI::App& app) {
  auto o = std::make_shared<RenderOptions>();
  addSceneOptions(app, o->scene, "SCENE", "Scene (.xml) or volume (.vdb, .nvdb, .vol)");
  app.add_option("-m,--method", o->method, "Method, see \"virga methods\"")->type_name("METHOD")->capture_default_str();
  addRepeated(app, "-o,--output", o->outputs, "Picture, .exr (linear) or .png (tone mapped); give both by -o twice",
              "FILE");
  addStopRules(app, o->stop);
  addParsed(
      app, "--audit", [o](const std::string& t) { o->auditSeconds = positive("--audit", t); },
      "Then spend SEC seconds of path on random pixels: the picture's bias and relMSE", "SEC");
  addParsed(
      app, "--size", [o](const std::string& t) { o->size = imageSize(t); },
      "Size of the film in place of the scene's; a crop window scales with it", "WxH");
  addParsed(
      app, "--frames", [o](const std::string& t) { o->frames = framesOf(t); },
      "A picture for each: $frame in the scene is 0001, 0002 ... and the time of its animations. Files are numbered: "
      "out.exr is out.0001.exr, out_###.exr is out_001.exr",
      "A..B");
  addParsed(
      app, "--seed", [o](const std::string& t) { o->seed = wholeNumber<uint64_t>("--seed", t, 0, UINT64_MAX); },
      "Seed of all randomness", "N");
  addParsed(
      app, "--threads", [o](const std::string& t) { o->threads = wholeNumber("--threads", t, 1, 4096); },
      "Threads; the picture does not depend on it", "N");
  addRepeated(app, "--set", o->settings, "Parameter of the method; repeatable", "method.param=value");
  app.add_flag("--layers", o->layers, "Add all transport layers and the variances to the EXR");
  app.add_option("--dots", o->dots, "Write the picture with the method's virtual lights as dots over it")
      ->type_name("FILE.png");
  app.add_option("--stats", o->stats, "Write timings and counts as JSON")->type_name("FILE");
  app.add_flag("-q,--quiet", o->quiet, "Print nothing but errors");
  app.footer(
      "Ctrl-C writes the picture as it is then (after the first pass, if need be); a second one quits at once.\n"
      "Of a sequence it leaves the frames that are finished.\n");
  return [o] { return render(*o); };
}

Action addCompare(CLI::App& app) {
  auto o = std::make_shared<CompareOptions>();
  app.add_option("IMAGE", o->image, "Picture")->required()->type_name("");
  app.add_option("REFERENCE", o->reference, "Picture to hold it against")->required()->type_name("");
  app.add_option("--layer", o->layer, "Compare this layer of two EXRs, not the beauty")->type_name("LAYER");
  app.add_option("--diff", o->difference, "Write the signed difference (green too dark, red too bright, x2)")
      ->type_name("PNG");
  app.add_flag("--json", o->json, "Print JSON");
  return [o] { return compare(*o); };
}

Action addInfo(CLI::App& app) {
  auto o = std::make_shared<SceneOptions>();
  addSceneOptions(app, *o, "FILE", "Scene (.xml), volume (.vdb, .nvdb, .vol), mesh (.obj, .ply) or picture");
  return [o] { return info(*o); };
}

Action addMake(CLI::App& app) {
  auto o = std::make_shared<MakeOptions>();
  app.add_option("KIND", o->kind, "smoke, cloud, fog or dust")->required()->type_name("");
  app.add_option("-o,--output", o->output, "Volume (.vdb, .nvdb, .vol), or a scene (.xml) with its volume beside it")
      ->required()
      ->type_name("FILE");
  app.add_option("--scene", o->scene, "Also write a scene with the volume, a light, a ground and a camera")
      ->type_name("FILE.xml");
  addParsed(
      app, "--resolution", [o](const std::string& t) { o->resolution = wholeNumber("--resolution", t, 2, 2048); },
      "Voxels along each side", "N")
      ->default_str("128");
  addParsed(
      app, "--seed", [o](const std::string& t) { o->seed = wholeNumber<uint32_t>("--seed", t, 0, UINT32_MAX); },
      "Seed of the shape", "N")
      ->default_str("0");
  addParsed(
      app, "--frames", [o](const std::string& t) { o->frames = wholeNumber("--frames", t, 1, 9999); },
      "A sequence: name.0001.vdb, name.0002.vdb ...", "N");
  return [o] { return make(*o); };
}

Action addMethods(CLI::App& app) {
  auto name = std::make_shared<std::string>();
  app.add_option("NAME", *name, "Tell about this method: parameters and layers")->type_name("");
  return [name] { return methods(*name); };
}

/// One row for each command.
struct CommandRow {
  const char* name;
  const char* summary;
  Action (*add)(CLI::App&);
};

constexpr CommandRow kCommands[] = {
    {"render", "Render a scene or a bare volume", addRender},
    {"compare", "Tell how far a picture is from a reference", addCompare},
    {"info", "Tell what is in a scene, a volume, a mesh or a picture", addInfo},
    {"make", "Make a procedural volume, and a scene around it", addMake},
    {"methods", "List the rendering methods, or tell about one", addMethods},
};

std::string withSuggestion(const std::string& message, std::string_view word, const std::vector<std::string>& known) {
  const std::string suggestion = didYouMean(word, known);
  return suggestion.empty() ? message : message + "; " + suggestion;
}

void requireKnownCommand(const std::string& word) {
  std::vector<std::string> known;
  for (const CommandRow& row : kCommands) known.emplace_back(row.name);
  if (std::find(known.begin(), known.end(), word) != known.end()) return;
  const std::string message = withSuggestion(fmt::format("unknown command \"{}\"", word), word, known);
  throw UsageError(fmt::format("{}\n  note: available: {}", message, joined(known)));
}

/// "--spp" of "--spp=4", "-D" of "-Da=b".
std::string optionName(const std::string& argument) {
  return argument.starts_with("--") ? argument.substr(0, argument.find('=')) : argument.substr(0, 2);
}

// The parser's own message about an unknown option lacks a suggestion and comes after those about what is missing.
void requireKnownOptions(CLI::App& command, int first, int argc, char** argv) {
  std::vector<std::string> known;
  for (const CLI::Option* option : command.get_options()) {
    for (const std::string& name : option->get_lnames()) known.push_back("--" + name);
    for (const std::string& name : option->get_snames()) known.push_back("-" + name);
  }
  for (int i = first; i < argc; ++i) {
    const std::string argument = argv[i];
    if (argument == "--") return;
    const bool isNumber = argument.size() >= 2 && argument[1] >= '0' && argument[1] <= '9';
    if (argument.size() < 2 || argument[0] != '-' || isNumber) continue;
    const std::string name = optionName(argument);
    if (std::find(known.begin(), known.end(), name) != known.end()) continue;
    const std::string program = first == 1 ? "virga" : "virga " + command.get_name();
    throw UsageError(withSuggestion(fmt::format("unknown option \"{}\"", name), name, known) +
                     fmt::format("\n  note: \"{} --help\" lists the options", program));
  }
}

void describeProgram(CLI::App& app) {
  app.set_version_flag("--version", "virga " VIRGA_VERSION);
  app.require_subcommand(1);
  app.footer(
      "Exit codes: 0 done, 1 bad input, 2 wrong usage, 130 interrupted without a picture.\n"
      "\"virga COMMAND --help\" lists the options of a command.\n");
}

void parse(CLI::App& app, int argc, char** argv) {
  try {
    app.parse(argc, argv);
  } catch (const CLI::Success&) {
    throw;
  } catch (const CLI::ParseError& error) {
    throw UsageError(fmt::format("{}\n  note: \"virga {} --help\" tells more", error.what(), argv[1]));
  }
}

}  // namespace

int runCommandLine(int argc, char** argv) {
  CLI::App app("Virga renders participating media: smoke, cloud, fog.", "virga");
  describeProgram(app);
  Action action;
  for (const CommandRow& row : kCommands) {
    CLI::App& command = *app.add_subcommand(row.name, row.summary);
    const Action run = row.add(command);
    command.callback([&action, run] { action = run; });
  }
  if (argc < 2) {
    fmt::print(stderr, "{}", app.help());
    return 2;
  }
  if (argv[1][0] != '-') {
    requireKnownCommand(argv[1]);
    requireKnownOptions(*app.get_subcommand(argv[1]), 2, argc, argv);
  } else {
    requireKnownOptions(app, 1, argc, argv);
  }
  try {
    parse(app, argc, argv);
  } catch (const CLI::Success& wish) {  // --help, --version
    return app.exit(wish);
  }
  return action();
}

}  // namespace virga::app
