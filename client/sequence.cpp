// Sequences of the client library, over proto's container reader.
#include "client/grid_impl.h"
#include "proto/container/sequence_format.h"

namespace voxeld::client {

struct Sequence::Impl {
  std::vector<std::byte> container;
  SequenceReader reader;
  RawStreams streams;  // of the last frame read

  explicit Impl(std::vector<std::byte> bytes)
      : container(std::move(bytes)),
        reader(checked(SequenceReader::open(
            std::span(reinterpret_cast<const uint8_t*>(container.data()), container.size())))) {}
};

Sequence::Sequence(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Sequence::Sequence(Sequence&&) noexcept = default;
Sequence& Sequence::operator=(Sequence&&) noexcept = default;
Sequence::~Sequence() = default;

Sequence Sequence::decode(std::vector<std::byte> container) {
  return Sequence(std::make_unique<Impl>(std::move(container)));
}

std::array<int, 3> Sequence::dims() const {
  return impl_->reader.header().dims;
}
std::array<double, 3> Sequence::origin() const {
  return impl_->reader.header().origin;
}
std::array<double, 3> Sequence::voxel_size() const {
  return impl_->reader.header().voxel_size;
}
const std::string& Sequence::meta_json() const {
  return impl_->reader.header().meta_json;
}
double Sequence::fps() const {
  return impl_->reader.fps();
}
std::size_t Sequence::frame_count() const {
  return impl_->reader.frame_count();
}

std::vector<std::string_view> Sequence::channels() const {
  std::vector<std::string_view> names;
  for (const ChannelInfo& info : kChannels) {
    if (impl_->reader.header().channels.has(info.channel)) names.push_back(info.name);
  }
  return names;
}

void Sequence::check_frame(std::size_t index) const {
  if (index < frame_count()) return;
  throw Error("not-found", 0, "frame", "0 to " + std::to_string(frame_count() - 1),
              std::to_string(index));
}

double Sequence::time_s(std::size_t index) const {
  check_frame(index);
  return impl_->reader.time_s(index);
}

std::uint64_t Sequence::voxel_count(std::size_t index) const {
  check_frame(index);
  return impl_->reader.voxel_count(index);
}

Grid Sequence::frame(std::size_t index) {
  check_frame(index);
  return Grid(Grid::Impl::of(impl_->reader.header(),
                             checked(impl_->reader.decode_frame(index, &impl_->streams)),
                             impl_->reader.voxel_count(index)));
}

}  // namespace voxeld::client
