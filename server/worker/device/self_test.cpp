#include "server/worker/device/self_test.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <iterator>
#include <numbers>
#include <optional>
#include <utility>

#include "server/grid/content_hash.h"
#include "server/worker/device/self_test_scene.h"

namespace voxeld {
namespace {

// Two tiles, the second of which is cut.
constexpr std::array<int, 3> kDims = {300, 48, 48};

constexpr ChannelSet kColor{.color = true};
constexpr ChannelSet kColorAndNormal{.color = true, .normal = true};
constexpr ChannelSet kNormal{.normal = true};
constexpr ChannelSet kIds{.material = true, .label = true, .coverage = true};

struct Request {
  std::string step;
  const Scene* scene;
  VoxelizeOptions options;
};

// The scenes, and requests on them that together run every pass.
class Requests {
 public:
  explicit Requests(bool is_brief) {
    for (const auto& [rule, name] :
         {std::pair{Rule::kTouch, "touch"}, {Rule::kThin, "thin"}, {Rule::kCenter, "center"}}) {
      Request& request = add(occupancy, name, scenes_[0], ChannelSet{});
      request.options.rule = rule;
    }
    for (const Scene& scene : scenes_) {
      // Brief: the first and the last program.
      if (!is_brief || &scene == &scenes_.front()) {
        add(attributes, "colors of " + scene.format, scene, kColor);
      }
      if (!is_brief || &scene == &scenes_.back()) {
        add(attributes, "colors and normals of " + scene.format, scene, kColorAndNormal);
      }
    }
    add(attributes, "normals", scenes_[0], kNormal);
    add(attributes, "ids and coverage", scenes_[0], kIds);
    for (const auto& [mode, name] : {std::pair{ColorMode::kNearest, "nearest"},
                                     {ColorMode::kDominant, "dominant"},
                                     {ColorMode::kShaded, "shaded"}}) {
      add(attributes, std::string(name) + " colors", scenes_.back(), kColorAndNormal)
          .options.color = mode;
    }
    for (const auto& [sign, name] : {std::pair{Sign::kParity, "parity"},
                                     {Sign::kNonzero, "nonzero"},
                                     {Sign::kMajority, "majority"},
                                     {Sign::kFlood, "flood"},
                                     {Sign::kWinding, "winding"}}) {
      Request& request = add(solids, name, scenes_[0], ChannelSet{});
      request.options.fill = Fill::kSolid;
      request.options.sign = sign;
    }
  }
  Requests(const Requests&) = delete;
  Requests& operator=(const Requests&) = delete;

  std::vector<Request> occupancy, attributes, solids;

 private:
  static Request& add(std::vector<Request>& list, std::string step, const Scene& scene,
                      const ChannelSet& channels) {
    Request request{std::move(step), &scene, {}};
    request.options.placement.dims = kDims;
    request.options.placement.bounds = {0, 0, 0, kDims[0], kDims[1], kDims[2]};
    request.options.channels = channels;
    return list.emplace_back(std::move(request));
  }

  const std::vector<Scene> scenes_ = self_test_scenes();
};

class SelfTest {
 public:
  SelfTest(const TestedDevice& device, const DeviceFaults& known, const SelfTestProgress& progress)
      : device_(device), progress_(progress), requests_(device.is_brief), faults_(known) {}

  DeviceFaults run() {
    for (const PipelineChoice pipeline : {PipelineChoice::kCompute, PipelineChoice::kRaster}) {
      const bool is_compute = pipeline == PipelineChoice::kCompute;
      test(is_compute ? DevicePart::kCompute : DevicePart::kRaster, pipeline, requests_.occupancy);
      test(is_compute ? DevicePart::kComputeAttributes : DevicePart::kRasterAttributes, pipeline,
           requests_.attributes);
    }
    test_solids();
    test_images();
    return faults_;
  }

 private:
  Result<Grid> grid(const Request& request, PipelineChoice pipeline) const {
    VoxelizeOptions options = request.options;
    options.pipeline = pipeline;
    return device_.voxelizer.voxelize(*request.scene, options, {}, nullptr);
  }

  // The fault of one request; empty: none.
  std::string fault_of(const Request& request, PipelineChoice pipeline) const {
    const auto found = grid(request, pipeline);
    if (!found) return request.step + ": " + found.error().message();
    const auto expected = grid(request, PipelineChoice::kCpu);
    if (!expected) return request.step + ": on the CPU: " + expected.error().message();
    if (content_hash(*found) == content_hash(*expected)) return "";
    const uint64_t voxels = found->voxel_count(), wanted = expected->voxel_count();
    if (voxels == wanted) return request.step + ": other values than the CPU's";
    return request.step + ": " + std::to_string(voxels) + " voxels, " + std::to_string(wanted) +
           " on the CPU";
  }

  void test(DevicePart part, PipelineChoice pipeline, const std::vector<Request>& requests) {
    for (const Request& request : requests) {
      if (faults_.has(part)) return;
      progress_(part, request.step);
      if (std::string fault = fault_of(request, pipeline); !fault.empty()) {
        faults_.add(part, std::move(fault));
      }
    }
  }

  // The device fills what a pipeline of its own has the surface of, so one must be in order.
  void test_solids() {
    const bool by_compute = !faults_.has(DevicePart::kCompute);
    if (!by_compute && faults_.has(DevicePart::kRaster)) {
      faults_.add(DevicePart::kSolid, "no pipeline of the device makes its surface");
      return;
    }
    test(DevicePart::kSolid, by_compute ? PipelineChoice::kCompute : PipelineChoice::kRaster,
         requests_.solids);
  }

  void test_images() {
    if (device_.gl_renderer == nullptr || faults_.has(DevicePart::kImages)) return;
    progress_(DevicePart::kImages, "grid");
    const auto colored = grid(requests_.attributes[1], PipelineChoice::kCpu);
    if (!colored) return;  // the CPU's failure is no fault of the device
    Status loaded = device_.cpu_renderer.set_grid(*colored);
    if (loaded) loaded = device_.gl_renderer->set_grid(*colored);
    if (!loaded) {
      faults_.add(DevicePart::kImages, "grid: " + loaded.error().message());
      return;
    }
    for (const auto& [style, name] : {std::pair{Style::kVoxel, "voxel"},
                                      {Style::kSmooth, "smooth"},
                                      {Style::kBlueprint, "blueprint"}}) {
      if (faults_.has(DevicePart::kImages)) return;
      progress_(DevicePart::kImages, name);
      if (std::string fault = image_fault(style); !fault.empty()) {
        faults_.add(DevicePart::kImages, std::string(name) + ": " + fault);
      }
    }
  }

  std::string image_fault(Style style) const {
    RenderOptions options;
    options.width = options.height = 48;
    options.style = style;
    const auto found = device_.gl_renderer->render(options, {});
    if (!found) return found.error().message();
    const auto expected = device_.cpu_renderer.render(options, {});
    if (!expected) return "";
    // Hits are equal. Colours may differ by a step where they are rounded, and a few pixels by more
    // where a soft shadow's ray grazes an edge.
    constexpr int kStep = 2, kPixelsPerOutlier = 100;
    const auto outliers = std::ranges::count_if(differences(*found, *expected),
                                                [](int difference) { return difference > kStep; });
    const int64_t pixels = int64_t{options.width} * options.height;
    if (outliers * kPixelsPerOutlier <= pixels) return "";
    return std::to_string(outliers) + " of " + std::to_string(pixels) +
           " pixels have other colours than the CPU's";
  }

  // The largest difference of a channel, for each pixel.
  static std::vector<int> differences(const RenderImage& a, const RenderImage& b) {
    std::vector<int> list(a.rgba.size() / 4, 255);
    if (a.rgba.size() != b.rgba.size()) return list;
    for (size_t i = 0; i < list.size(); ++i) {
      list[i] = 0;
      for (size_t k = 4 * i; k < 4 * i + 4; ++k) {
        list[i] = std::max(list[i], std::abs(int{a.rgba[k]} - int{b.rgba[k]}));
      }
    }
    return list;
  }

  const TestedDevice& device_;
  const SelfTestProgress& progress_;
  const Requests requests_;
  DeviceFaults faults_;
};

}  // namespace

DeviceFaults self_test(const TestedDevice& device, const DeviceFaults& known,
                       const SelfTestProgress& progress) {
  return SelfTest(device, known, progress).run();
}

}  // namespace voxeld
