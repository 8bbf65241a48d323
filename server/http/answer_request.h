// From a request's head to the answer: ids, spoofable headers, the handler and its exceptions.
#pragma once

#include <string>
#include <vector>

#include "server/http/client_table.h"
#include "server/http/front.h"

namespace voxeld::http {

// Runs the handler on the client's request (or tells what is wrong with its head), fills in its
// record and whether the connection can go on. May wait for the body, and as long as the handler.
Response answer_request(Client& client, const Handler& handler, const FrontConfig& config);

// The address that a request comes from: the peer's, or the last one of X-Forwarded-For that is no
// trusted proxy's, where the peer is one. Takes the headers that clients can make up out of `head`.
std::string take_client_address(Head& head, const std::string& peer,
                                const std::vector<std::string>& trusted_proxies);

}  // namespace voxeld::http
