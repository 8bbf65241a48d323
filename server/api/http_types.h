// Names of the HTTP server that every part of the API uses.
#pragma once

#include "server/http/message/message.h"

namespace voxeld::api {

using http::add_vary;
using http::BodySink;
using http::Clock;
using http::content_disposition;
using http::FileBody;
using http::Head;
using http::header_safe;
using http::kPieceBytesMax;
using http::kTextBytesMax;
using http::Piece;
using http::PieceBody;
using http::RateState;
using http::Reply;
using http::Request;
using http::Response;
using http::StreamedBody;
using http::TextBody;
using http::Wait;

}  // namespace voxeld::api
