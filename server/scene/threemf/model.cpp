#include "server/scene/threemf/model.h"

#include <algorithm>
#include <utility>

#include "proto/limits.h"
#include "proto/text/number_text.h"
#include "server/base/pieces.h"
#include "server/scene/core/color_space.h"
#include "server/scene/core/mesh_error.h"
#include "server/scene/core/text_cursor.h"
#include "server/scene/threemf/xml.h"

namespace voxeld::threemf {
namespace {

constexpr std::string_view kCore = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02";
constexpr std::string_view kMaterials =
    "http://schemas.microsoft.com/3dmanufacturing/material/2015/02";
constexpr std::string_view kProduction =
    "http://schemas.microsoft.com/3dmanufacturing/production/2015/06";
constexpr size_t kUnreadNamesMax = 16;
constexpr uint32_t kNumberMax = uint32_t{1} << 31;  // of identifiers and indices, exclusive

class ModelReader {
 public:
  explicit ModelReader(std::string_view name) { model_.name = name; }

  Result<Model> read(std::span<const uint8_t> bytes) {
    XmlHandlers handlers;
    handlers.prefix = [this](std::string_view prefix, std::string_view space) {
      prefixes_.insert_or_assign(std::string(prefix), std::string(space));
    };
    handlers.start = [this](const XmlElement& element) { return start(element); };
    handlers.end = [this](std::string_view space, std::string_view element) {
      return end(space, element);
    };
    VOXELD_TRY(read_xml(model_.name, bytes, handlers));
    if (!has_model_) return malformed_mesh(model_.name, "", "no model", "<model>", "none");
    return std::move(model_);
  }

 private:
  Error wrong(const XmlElement& at, std::string_view what, std::string expected,
              std::string got) const {
    return malformed_line(model_.name, at.line,
                          std::string(at.name) + (what.empty() ? "" : " " + std::string(what)),
                          std::move(expected), std::move(got));
  }

  // An attribute that has to be there, as a number from 0 on.
  Result<uint32_t> number(const XmlElement& at, std::string_view name) const {
    const auto text = at.attribute(name);
    if (text) {
      const auto value = parse_number<uint32_t>(*text, 0, kNumberMax - 1);
      if (value) return *value;
    }
    return wrong(at, name, "an integer from 0 to " + std::to_string(kNumberMax - 1),
                 text ? shown(*text) : "nothing");
  }
  Result<uint32_t> number_or(const XmlElement& at, std::string_view name, uint32_t other) const {
    return at.attribute(name) ? number(at, name) : Result<uint32_t>(other);
  }

  Result<double> coordinate(const XmlElement& at, std::string_view name) const {
    const auto text = at.attribute(name);
    const auto value = text ? voxeld::parse_number(*text) : std::nullopt;
    if (value && is_coordinate(*value)) return *value;
    return wrong(at, name, "a finite number up to 1e30", text ? shown(*text) : "nothing");
  }

  // Twelve numbers by rows, for row vectors: the last three move.
  Result<glm::dmat4> transform(const XmlElement& at) const {
    glm::dmat4 out(1.0);
    const auto text = at.attribute("transform");
    if (!text) return out;
    LineCursor cursor(*text);
    for (int i = 0; i < 12; ++i) {
      const auto value = voxeld::parse_number(cursor.token());
      if (!value || !is_coordinate(*value)) {
        return wrong(at, "transform", "twelve numbers", shown(*text));
      }
      out[i / 3][i % 3] = *value;
    }
    if (cursor.at_end()) return out;
    return wrong(at, "transform", "twelve numbers", shown(*text));
  }

  // "#RRGGBB" or "#RRGGBBAA" in sRGB.
  Result<glm::vec4> color(const XmlElement& at, std::string_view name) const {
    const auto text = at.attribute(name);
    const auto digit = [](char c) {
      if (c >= '0' && c <= '9') return c - '0';
      if (c >= 'a' && c <= 'f') return c - 'a' + 10;
      return c >= 'A' && c <= 'F' ? c - 'A' + 10 : -1;
    };
    bool is_right = text && (text->size() == 7 || text->size() == 9) && text->front() == '#';
    std::array<float, 4> channels = {0, 0, 0, 1};
    for (size_t i = 0; is_right && 2 * i + 2 < text->size(); ++i) {
      const int high = digit((*text)[2 * i + 1]), low = digit((*text)[2 * i + 2]);
      is_right = high >= 0 && low >= 0;
      channels[i] = static_cast<float>(16 * high + low) / 255.0f;
    }
    if (!is_right) {
      return wrong(at, name, "#RRGGBB or #RRGGBBAA", text ? shown(*text) : "nothing");
    }
    return glm::vec4(linear_from_srgb(glm::vec3(channels[0], channels[1], channels[2])),
                     channels[3]);
  }

  Status count_resource(const XmlElement& at) {
    if (++resource_count_ <= kResourcesMax) return {};
    return wrong(at, "", "at most " + std::to_string(kResourcesMax) + " resources", "more");
  }

  Status start(const XmlElement& at) {
    if (at.space == kCore) return start_core(at);
    if (at.space == kMaterials) return start_materials(at);
    if (model_.unread_elements.size() < kUnreadNamesMax) {
      model_.unread_elements.emplace(at.name.substr(0, 40));
    }
    return {};
  }

  Status end(std::string_view space, std::string_view name) {
    if (space == kCore && name == "object") {
      Object& object = *object_;
      for (const uint32_t corner : object.corners) {
        if (corner < object.vertices.size()) continue;
        return malformed_mesh(model_.name, "object " + std::to_string(object_id_),
                              "index of a vertex", index_text(object.vertices.size(), "vertices"),
                              std::to_string(corner));
      }
      object_ = nullptr;
    }
    if (name == "basematerials" || name == "colorgroup" || name == "texture2dgroup") {
      group_ = nullptr;
    }
    return {};
  }

  Status start_core(const XmlElement& at) {
    const std::string_view name = at.name;
    if (name == "vertex") return add_vertex(at);
    if (name == "triangle") return add_triangle(at);
    if (name == "model") return start_model(at);
    if (name == "object") return start_object(at);
    if (name == "component") return add_component(at);
    if (name == "item") return add_item(at);
    if (name == "basematerials") return start_group(at);
    if (name == "base") return add_base(at);
    return {};  // metadata, resources, mesh, vertices, triangles, components, build
  }

  Status start_materials(const XmlElement& at) {
    const std::string_view name = at.name;
    if (name == "colorgroup" || name == "texture2dgroup") return start_group(at);
    if (name == "color" && group_ != nullptr) {
      VOXELD_TRY(count_resource(at));
      VOXELD_ASSIGN(const glm::vec4 one, color(at, "color"));
      group_->colors.push_back(one);
      return {};
    }
    if (name == "tex2coord" && group_ != nullptr) {
      VOXELD_TRY(count_resource(at));
      VOXELD_ASSIGN(const double u, coordinate(at, "u"));
      VOXELD_ASSIGN(const double v, coordinate(at, "v"));
      group_->uvs.emplace_back(u, 1.0 - v);
      return {};
    }
    if (name == "texture2d") return add_texture(at);
    if (model_.unread_elements.size() < kUnreadNamesMax) model_.unread_elements.emplace(name);
    return {};
  }

  Status start_model(const XmlElement& at) {
    has_model_ = true;
    LineCursor required(at.attribute("requiredextensions").value_or(""));
    while (!required.at_end()) {
      const std::string prefix(required.token());
      const auto found = prefixes_.find(prefix);
      const std::string space = found == prefixes_.end() ? prefix : found->second;
      if (space == kCore || space == kMaterials || space == kProduction) continue;
      Error error = wrong(at, "requires an extension", "materials or production", shown(space));
      error.code = ErrorCode::kUnsupportedFeature;
      return error;
    }
    return {};
  }

  Status start_object(const XmlElement& at) {
    VOXELD_TRY(count_resource(at));
    if (object_ != nullptr) return wrong(at, "", "no object inside another", "one");
    VOXELD_ASSIGN(object_id_, number(at, "id"));
    const auto [found, is_new] = model_.objects.try_emplace(object_id_);
    if (!is_new) return wrong(at, "id", "one that no other object has", std::to_string(object_id_));
    object_ = &found->second;
    object_->name = at.attribute("name").value_or("");
    object_->type = at.attribute("type").value_or("model");
    VOXELD_ASSIGN(object_->property.group, number_or(at, "pid", 0));
    VOXELD_ASSIGN(object_->property.index, number_or(at, "pindex", 0));
    return {};
  }

  Status add_vertex(const XmlElement& at) {
    if (object_ == nullptr) return wrong(at, "", "an object around it", "none");
    if (++vertex_count_ > limits::kVerticesMax) {
      return over_limit(model_.name, "line " + std::to_string(at.line), "vertices",
                        limits::kVerticesMax, vertex_count_);
    }
    glm::dvec3 p;
    VOXELD_ASSIGN(p.x, coordinate(at, "x"));
    VOXELD_ASSIGN(p.y, coordinate(at, "y"));
    VOXELD_ASSIGN(p.z, coordinate(at, "z"));
    push_in_pieces(object_->vertices, p);
    return {};
  }

  Status add_triangle(const XmlElement& at) {
    if (object_ == nullptr) return wrong(at, "", "an object around it", "none");
    if (++triangle_count_ > limits::kTrianglesMax) {
      return over_limit(model_.name, "line " + std::to_string(at.line), "triangles",
                        limits::kTrianglesMax, triangle_count_);
    }
    Object& object = *object_;
    for (const char* name : {"v1", "v2", "v3"}) {
      VOXELD_ASSIGN(const uint32_t corner, number(at, name));
      push_in_pieces(object.corners, corner);
    }
    if (!at.attribute("p1") && object.properties.empty()) return {};
    // Without p1 a triangle has the object's property, whatever its pid says.
    Property property = object.property;
    if (at.attribute("p1")) {
      VOXELD_ASSIGN(property.group, number_or(at, "pid", object.property.group));
      VOXELD_ASSIGN(property.index, number(at, "p1"));
    }
    resize_in_pieces(object.properties, object.corners.size() - 3, object.property);
    push_in_pieces(object.properties, property);
    for (const char* name : {"p2", "p3"}) {
      Property corner = property;
      if (at.attribute("p1")) {
        VOXELD_ASSIGN(corner.index, number_or(at, name, property.index));
      }
      push_in_pieces(object.properties, corner);
    }
    return {};
  }

  Result<Reference> reference(const XmlElement& at) {
    VOXELD_TRY(count_resource(at));
    Reference out;
    VOXELD_ASSIGN(out.object, number(at, "objectid"));
    VOXELD_ASSIGN(out.transform, transform(at));
    out.path = at.attribute("path", kProduction).value_or("");
    out.line = at.line;
    return out;
  }

  Status add_component(const XmlElement& at) {
    if (object_ == nullptr) return wrong(at, "", "an object around it", "none");
    VOXELD_ASSIGN(Reference component, reference(at));
    object_->components.push_back(std::move(component));
    return {};
  }

  Status add_item(const XmlElement& at) {
    VOXELD_ASSIGN(Reference item, reference(at));
    model_.items.push_back(std::move(item));
    return {};
  }

  Status start_group(const XmlElement& at) {
    VOXELD_TRY(count_resource(at));
    VOXELD_ASSIGN(const uint32_t id, number(at, "id"));
    const auto [found, is_new] = model_.groups.try_emplace(id);
    if (!is_new) return wrong(at, "id", "one that no other group has", std::to_string(id));
    group_ = &found->second;
    if (at.name == "texture2dgroup") {
      VOXELD_ASSIGN(group_->texture, number(at, "texid"));
    }
    return {};
  }

  Status add_base(const XmlElement& at) {
    if (group_ == nullptr) return wrong(at, "", "basematerials around it", "none");
    VOXELD_TRY(count_resource(at));
    BaseMaterial material;
    material.name = at.attribute("name").value_or("");
    VOXELD_ASSIGN(material.color, color(at, "displaycolor"));
    group_->materials.push_back(std::move(material));
    return {};
  }

  Status add_texture(const XmlElement& at) {
    VOXELD_TRY(count_resource(at));
    VOXELD_ASSIGN(const uint32_t id, number(at, "id"));
    TextureSource& texture = model_.textures[id];
    texture.path = at.attribute("path").value_or("");
    const auto wrap = [&](std::string_view name) {
      const std::string_view style = at.attribute(name).value_or("wrap");
      if (style == "mirror") return Wrap::kMirror;
      return style == "clamp" || style == "none" ? Wrap::kClamp : Wrap::kRepeat;
    };
    texture.wrap_u = wrap("tilestyleu");
    texture.wrap_v = wrap("tilestylev");
    return {};
  }

  Model model_;
  std::map<std::string, std::string> prefixes_;
  bool has_model_ = false;
  Object* object_ = nullptr;  // that is being read
  uint32_t object_id_ = 0;
  PropertyGroup* group_ = nullptr;  // that is being read
  size_t resource_count_ = 0;
  int64_t vertex_count_ = 0, triangle_count_ = 0;
};

}  // namespace

Result<Model> read_model(std::string_view name, std::span<const uint8_t> bytes) {
  return ModelReader(name).read(bytes);
}

bool looks_like_model(std::string_view head) {
  return head.find("<model") != head.npos && head.find(kCore) != head.npos;
}

}  // namespace voxeld::threemf
