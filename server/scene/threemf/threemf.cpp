// Loads a 3MF package: the objects of its build, with the colours of base materials, colour groups
// and textures. Additions of slicers (settings, thumbnails, paint) are ignored.
#include <algorithm>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include <glm/matrix.hpp>

#include "proto/limits.h"
#include "proto/text/number_text.h"
#include "server/base/cancel_point.h"
#include "server/base/pieces.h"
#include "server/scene/core/loaders.h"
#include "server/scene/core/mesh_error.h"
#include "server/scene/core/name_list.h"
#include "server/scene/core/vertex_table.h"
#include "server/scene/images/textures.h"
#include "server/scene/threemf/model.h"
#include "server/scene/threemf/xml.h"

namespace voxeld {
namespace {

using threemf::Model;
using threemf::Object;
using threemf::Property;
using threemf::PropertyGroup;
using threemf::Reference;

constexpr int kComponentDepthMax = 64;
// Components that are followed. More: malformed-mesh. Each level of a file may double them.
constexpr size_t kPlacedObjectsMax = size_t{1} << 20;
constexpr std::string_view kRelationships = "_rels/.rels";
// PrusaSlicer and programs made from it put modifiers, support blockers and negative volumes into
// the mesh of their object, and tell here which triangles these are.
constexpr std::string_view kSlicerVolumes = "Metadata/Slic3r_PE_model.config";
constexpr std::string_view kModelType =
    "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel";

// A name in a package, which begins with its root, as bundles name files.
std::string_view without_root(std::string_view path) {
  return path.starts_with('/') ? path.substr(1) : path;
}

// Whether a part of the object has colours or texture coordinates, and its material.
struct Surface {
  int material = -1;
  bool has_color = false, has_uv = false;
  bool operator<(const Surface& other) const {
    return std::tie(material, has_color, has_uv) <
           std::tie(other.material, other.has_color, other.has_uv);
  }
};

// The part that the triangles of one surface go to, while an object is added.
struct OpenPart {
  size_t index = 0;
  VertexTable vertices = VertexTable();
};

struct TriangleRange {
  uint32_t first = 0, last = 0;
};
using VolumeRanges = std::map<uint32_t, std::vector<TriangleRange>>;  // by object, ascending

// The triangles of the first model part that are no part of the model. A file that is broken says
// nothing.
Result<VolumeRanges> read_helper_volumes(const Bundle& bundle) {
  VolumeRanges ranges;
  VOXELD_ASSIGN(const auto bytes, bundle.find(kSlicerVolumes, ""));
  if (!bytes) return ranges;
  std::optional<uint32_t> object, first, last;
  bool is_part = true;
  threemf::XmlHandlers handlers;
  handlers.start = [&](const threemf::XmlElement& at) -> Status {
    const auto number = [&](std::string_view name) {
      return parse_number<uint32_t>(at.attribute(name).value_or(""));
    };
    if (at.name == "object") object = number("id");
    if (at.name == "volume") {
      first = number("firstid");
      last = number("lastid");
      is_part = true;
    }
    if (at.name != "metadata" || at.attribute("type") != "volume") return {};
    const std::string_view key = at.attribute("key").value_or("");
    const std::string_view value = at.attribute("value").value_or("");
    if (key == "modifier" && value == "1") is_part = false;  // of older versions
    if (key == "volume_type") is_part = value == "ModelPart";
    return {};
  };
  handlers.end = [&](std::string_view, std::string_view name) -> Status {
    if (name == "volume" && !is_part && object && first && last && *first <= *last) {
      ranges[*object].push_back({*first, *last});
    }
    return {};
  };
  if (!threemf::read_xml(kSlicerVolumes, *bytes, handlers)) return VolumeRanges();
  for (auto& [id, list] : ranges) std::ranges::sort(list, {}, &TriangleRange::first);
  return ranges;
}

class PackageLoader {
 public:
  PackageLoader(std::string_view name, const Bundle& bundle, const LoadOptions& options)
      : name_(name),
        bundle_(bundle),
        textures_(scene_, bundle, std::string(name), options),
        meshes_(scene_.meshes),
        nodes_(scene_.nodes) {}

  Result<Scene> load(std::span<const uint8_t> bytes) {
    scene_.format = "3mf";
    VOXELD_ASSIGN(Model start, threemf::read_model(name_, bytes));
    const Model& model = keep(std::string(name_), std::move(start));
    VOXELD_ASSIGN(helper_volumes_, read_helper_volumes(bundle_));
    for (size_t i = 0; i < model.items.size(); ++i) {
      item_ = i;
      VOXELD_TRY(place(model, model.items[i], glm::dmat4(1.0), 0));
    }
    if (skipped_count_ > 0) {
      add_warning(scene_, "skipped-object",
                  std::string(name_) + ": " + std::to_string(skipped_count_) +
                      " objects of supports or of type other were left out");
    }
    if (helper_triangle_count_ > 0) {
      add_warning(scene_, "skipped-object",
                  std::string(name_) + ": " + std::to_string(helper_triangle_count_) +
                      " triangles of modifiers, supports or negative volumes were left out");
    }
    if (scene_.triangle_count() > 0) return std::move(scene_);
    return empty_mesh(name_, model.items.empty() ? "no item in the build" : "no triangles in it");
  }

 private:
  const Model& keep(std::string path, Model model) {
    for (const std::string& element : model.unread_elements) {
      add_warning(scene_, "ignored-extension",
                  path + ": elements " + shown(element) + " of an extension are not read");
    }
    return models_.insert_or_assign(std::move(path), std::move(model)).first->second;
  }

  Result<const Model*> model_at(const Model& from, const Reference& reference) {
    if (reference.path.empty()) return &from;
    std::string path(without_root(reference.path));
    if (const auto found = models_.find(path); found != models_.end()) return &found->second;
    VOXELD_ASSIGN(const auto bytes, bundle_.find(path, ""));
    if (!bytes) {
      return malformed_line(from.name, reference.line, "the model part is not in the package",
                            "one of its files", shown(path));
    }
    VOXELD_ASSIGN(Model model, threemf::read_model(path, *bytes));
    return &keep(std::move(path), std::move(model));
  }

  Status place(const Model& from, const Reference& reference, const glm::dmat4& world_from_parent,
               int depth) {
    cancel_point();
    VOXELD_ASSIGN(const Model* const model, model_at(from, reference));
    const auto found = model->objects.find(reference.object);
    if (found == model->objects.end()) {
      return malformed_line(from.name, reference.line, "objectid", "an object of " + model->name,
                            std::to_string(reference.object));
    }
    if (depth > kComponentDepthMax) {
      return over_limit(from.name, "line " + std::to_string(reference.line), "depth of components",
                        kComponentDepthMax, depth);
    }
    if (++placed_count_ > kPlacedObjectsMax) {
      return over_limit(from.name, "line " + std::to_string(reference.line), "objects of the build",
                        kPlacedObjectsMax, static_cast<int64_t>(placed_count_));
    }
    const Object& object = found->second;
    if (object.type != "model" && object.type != "surface") {
      ++skipped_count_;
      return {};
    }
    const glm::dmat4 world_from_object = world_from_parent * reference.transform;
    VOXELD_TRY(add_object(*model, reference.object, object, world_from_object));
    for (const Reference& component : object.components) {
      VOXELD_TRY(place(*model, component, world_from_object, depth + 1));
    }
    return {};
  }

  Status add_object(const Model& model, uint32_t id, const Object& object,
                    const glm::dmat4& world_from_object) {
    if (object.corners.empty()) return {};
    triangle_count_ += static_cast<int64_t>(object.corners.size() / 3);
    if (triangle_count_ > limits::kTrianglesMax) {
      return over_limit(name_, "", "triangles of the build", limits::kTrianglesMax,
                        triangle_count_);
    }
    std::vector<glm::dvec3> positions;
    positions.reserve(object.vertices.size());
    for (const glm::dvec3& p : object.vertices) {
      cancel_point();
      positions.emplace_back(world_from_object * glm::dvec4(p, 1.0));
      const glm::dvec3& q = positions.back();
      if (is_coordinate(q.x) && is_coordinate(q.y) && is_coordinate(q.z)) continue;
      return malformed_mesh(model.name, "object " + std::to_string(id),
                            "a vertex is at no finite place",
                            "coordinates of at most 1e30 in size");
    }
    const bool is_mirrored = glm::determinant(glm::dmat3(world_from_object)) < 0.0;
    std::map<Surface, OpenPart> open;
    const auto found =
        helper_volumes_.find(model.name == name_ ? id : 0);  // identifiers begin at 1
    std::span<const TriangleRange> helpers;
    if (found != helper_volumes_.end()) helpers = found->second;
    for (size_t i = 0; i + 2 < object.corners.size(); i += 3) {
      cancel_point();
      while (!helpers.empty() && helpers.front().last < i / 3) helpers = helpers.subspan(1);
      if (!helpers.empty() && helpers.front().first <= i / 3) {
        ++helper_triangle_count_;
        continue;
      }
      std::array<Property, 3> properties;
      properties.fill(object.property);
      if (!object.properties.empty()) std::copy_n(&object.properties[i], 3, properties.begin());
      VOXELD_ASSIGN(const Surface surface, surface_of(model, properties[0]));
      auto [at, is_new] = open.try_emplace(surface);
      if (is_new) at->second.index = open_part(model, id, object, surface);
      for (size_t c = 0; c < 3; ++c) {
        const size_t corner = is_mirrored && c > 0 ? 3 - c : c;
        VOXELD_TRY(add_corner(model, object.corners[i + corner], properties[corner], surface,
                              positions, at->second));
      }
    }
    return {};
  }

  // A part of its own, or in a full scene the last one with the same surface.
  size_t open_part(const Model& model, uint32_t id, const Object& object, const Surface& surface) {
    const auto last = part_of_surface_.find(surface);
    if (scene_.parts.size() >= kScenePartsMax && last != part_of_surface_.end()) {
      scene_.parts_merged = true;
      return last->second;
    }
    const auto object_name = [&] {
      return object.name.empty() ? "object " + std::to_string(id) : object.name;
    };
    MeshPart part;
    part.name = object_name().substr(0, kPartNameBytesMax);
    part.material = surface.material;
    part.mesh = meshes_.index_of({model.name, id}, object_name);
    part.node = nodes_.index_of(item_, [&] { return "item " + std::to_string(item_); });
    part_of_surface_[surface] = scene_.parts.size();
    scene_.parts.push_back(std::move(part));
    return scene_.parts.size() - 1;
  }

  Status add_corner(const Model& model, uint32_t vertex, const Property& property,
                    const Surface& surface, const std::vector<glm::dvec3>& positions,
                    OpenPart& open) {
    MeshPart& part = scene_.parts[open.index];
    const bool has_attribute = surface.has_color || surface.has_uv;
    const Property used = has_attribute ? property : Property();
    const auto next = static_cast<uint32_t>(part.positions.size());
    const auto [number, is_new] =
        open.vertices.find_or_add({vertex, used.group, used.index, 0}, next);
    push_in_pieces(part.indices, number);
    if (!is_new) return {};
    if (++vertex_count_ > limits::kVerticesMax) {
      return over_limit(name_, "", "vertices of the build", limits::kVerticesMax, vertex_count_);
    }
    push_in_pieces(part.positions, positions[vertex]);
    if (!has_attribute) return {};
    const auto group = model.groups.find(property.group);
    const size_t count = group == model.groups.end() ? 0
                         : surface.has_color         ? group->second.colors.size()
                                                     : group->second.uvs.size();
    if (property.index >= count) return wrong_property(model, property, count);
    if (surface.has_color) push_in_pieces(part.colors, group->second.colors[property.index]);
    if (surface.has_uv) push_in_pieces(part.uvs, group->second.uvs[property.index]);
    return {};
  }

  static Error wrong_property(const Model& model, const Property& property, size_t count) {
    return malformed_mesh(model.name, "group " + std::to_string(property.group),
                          "index of a property", index_text(count, "properties"),
                          std::to_string(property.index));
  }

  // Groups of kinds that are not read are as none.
  Result<Surface> surface_of(const Model& model, const Property& property) {
    Surface surface;
    const auto found = model.groups.find(property.group);
    if (found == model.groups.end()) return surface;
    const PropertyGroup& group = found->second;
    if (group.texture != 0) {
      VOXELD_ASSIGN(surface.material, texture_material(model, group.texture));
      surface.has_uv = true;
    } else if (!group.materials.empty()) {
      VOXELD_ASSIGN(surface.material, base_material(model, property, group));
    } else {
      surface.has_color = !group.colors.empty();
    }
    return surface;
  }

  Result<int> base_material(const Model& model, const Property& property,
                            const PropertyGroup& group) {
    if (property.index >= group.materials.size()) {
      return wrong_property(model, property, group.materials.size());
    }
    const auto [found, is_new] = materials_.try_emplace(
        {model.name, property.group, property.index}, static_cast<int>(scene_.materials.size()));
    if (is_new) {
      const threemf::BaseMaterial& from = group.materials[property.index];
      scene_.materials.push_back({.name = from.name, .base_color = from.color});
      scene_.colors_given = true;
    }
    return found->second;
  }

  Result<int> texture_material(const Model& model, uint32_t texture) {
    const auto source = model.textures.find(texture);
    if (source == model.textures.end()) {
      return malformed_mesh(model.name, "", "texid of a texture2dgroup", "a texture2d",
                            std::to_string(texture));
    }
    const auto [found, is_new] = materials_.try_emplace({model.name, texture, UINT32_MAX},
                                                        static_cast<int>(scene_.materials.size()));
    if (is_new) {
      const std::string_view path = without_root(source->second.path);
      Material material{.name = std::string(path),
                        .wrap_u = source->second.wrap_u,
                        .wrap_v = source->second.wrap_v};
      material.image = textures_.image_index(path, model.name);
      scene_.materials.push_back(std::move(material));
    }
    return found->second;
  }

  const std::string_view name_;
  const Bundle& bundle_;
  Scene scene_;
  TextureSet textures_;
  NameList<std::pair<std::string, uint32_t>> meshes_;
  NameList<size_t> nodes_;
  std::map<std::string, Model> models_;  // by path
  std::map<std::tuple<std::string, uint32_t, uint32_t>, int> materials_;
  std::map<Surface, size_t> part_of_surface_;
  size_t item_ = 0;  // that is being placed
  size_t placed_count_ = 0, skipped_count_ = 0;
  VolumeRanges helper_volumes_;
  int64_t helper_triangle_count_ = 0;
  int64_t triangle_count_ = 0, vertex_count_ = 0;
};

}  // namespace

Result<std::optional<std::string>> find_3mf_model(const Bundle& bundle) {
  std::optional<std::string> model;
  bool is_package = false;
  for (const Bundle::Entry& entry : bundle.entries()) is_package |= entry.name == kRelationships;
  if (!is_package) return model;
  VOXELD_ASSIGN(const auto bytes, bundle.find(kRelationships, ""));
  if (!bytes) return model;
  threemf::XmlHandlers handlers;
  handlers.start = [&](const threemf::XmlElement& element) -> Status {
    if (element.name != "Relationship" || element.attribute("Type") != kModelType) return {};
    model = std::string(without_root(element.attribute("Target").value_or("")));
    return {};
  };
  VOXELD_TRY(threemf::read_xml(kRelationships, *bytes, handlers));
  return model;
}

Result<Scene> load_3mf(std::string_view name, std::span<const uint8_t> bytes, const Bundle& bundle,
                       const LoadOptions& options) {
  return PackageLoader(name, bundle, options).load(bytes);
}

}  // namespace voxeld
