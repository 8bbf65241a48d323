// "/" and /openapi.json.
#include <array>

#include "server/api/accept.h"
#include "server/api/openapi_json.h"
#include "server/api/resources/resources.h"

namespace voxeld::api {
namespace {

constexpr std::string_view kIndex =
    "voxeld: meshes to voxels.\n\n"
    "  curl --data-binary @mesh.ply 'HOST/v1/voxelize?size=128&format=npz' -o grid.npz\n"
    "  curl --data-binary @mesh.ply 'HOST/v1/render?size=256' -o image.png\n\n"
    "Every route, parameter and response: /openapi.json\n";

}  // namespace

Reply get_index(Request& request, Api& api) {
  if (!has_page(api)) return Response::text(200, std::string(kIndex));
  request.is_negotiated = true;
  // The first of equals is the text, so curl gets it.
  constexpr std::array<std::string_view, 2> kTypes = {"text/plain", "text/html"};
  if (preferred_type(request.head.header("Accept"), kTypes) == 1) return get_page(request, api);
  Response response = Response::text(200, std::string(kIndex));
  response.headers["Cache-Control"] = "no-cache";
  return response;
}

Reply get_openapi(Request&, Api&) {
  Response response = Response::json(200, "");
  response.body = PieceBody{[left = openapi_json()]() mutable {
    Piece piece{std::string(left.substr(0, kPieceBytesMax)), left.size() <= kPieceBytesMax};
    left.remove_prefix(piece.text.size());
    return piece;
  }};
  response.headers["Cache-Control"] = "public, max-age=3600";
  return response;
}

}  // namespace voxeld::api
