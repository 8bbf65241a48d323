// "/" and /openapi.json.
#include "server/http/api.h"
#include "server/http/openapi_json.h"

namespace voxeld::http {
namespace {

constexpr std::string_view kIndex =
    "voxeld: meshes to voxels.\n\n"
    "  curl --data-binary @mesh.ply 'HOST/v1/voxelize?size=128&format=npz' -o grid.npz\n"
    "  curl --data-binary @mesh.ply 'HOST/v1/render?size=256' -o picture.png\n\n"
    "Every route, parameter and answer: /openapi.json\n";

}  // namespace

void add_index_routes(Router& router, Api&) {
  router.add("GET", "/", [](Request&) { return Response::text(200, std::string(kIndex)); });
  router.add("GET", "/openapi.json", [](Request&) {
    Response response = Response::json(200, "");
    response.body = PieceBody{[left = openapi_json()]() mutable {
      Piece piece{std::string(left.substr(0, kPieceBytesMax)), left.size() <= kPieceBytesMax};
      left.remove_prefix(piece.text.size());
      return piece;
    }};
    response.headers["Cache-Control"] = "public, max-age=3600";
    return response;
  });
}

}  // namespace voxeld::http
