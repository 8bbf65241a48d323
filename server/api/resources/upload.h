// Uploads: request bodies that go into the content-addressed store, never into memory as a whole.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "proto/messages/bundle_manifest.h"
#include "server/api/resources/api.h"
#include "server/api/resources/jobs/job_wait.h"
#include "server/store/object_store.h"

namespace voxeld::api {

// An upload that has been received and registered.
struct Upload {
  Asset asset;
  std::string filename;  // as requested, with the extension of its media type if it had none
  double ms = 0;         // from the head of the request to here
  WaitPlace place;
};

// Receives the body and calls `then`. The response is a problem instead: unsupported-media-type by
// Content-Type, bad-request for an empty body, errors of the body and the store, quota-exceeded
// (before anything is read if Content-Length tells), too-many-requests, and of bundle manifests
// malformed-bundle, not-found and gone for files that are not there.
Reply receive_upload(Request& request, Api& api, Durability durability,
                     std::function<Reply(Request&, Upload)> then);

}  // namespace voxeld::api
