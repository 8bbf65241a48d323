#include "server/formats/sequence_file.h"
#include "server/formats/sequence_formats.h"
#include "server/formats/sequence_writer.h"

namespace voxeld {

Status write_native_sequence(const FrameSource& source, const OutputOptions& options,
                             const std::filesystem::path& path) {
  GridHeader header = container_header(source.common());
  header.codecs = StreamCodecs::all(options.codec);
  VOXELD_ASSIGN(SequenceWriter writer, SequenceWriter::open(std::move(header), source.fps()));
  VOXELD_ASSIGN(SequenceFile file, SequenceFile::create(path));
  VOXELD_TRY(file.append(writer.front()));
  for (size_t i = 0; i < source.frame_count(); ++i) {
    VOXELD_ASSIGN(const Grid frame, source.frame(i));
    VOXELD_ASSIGN(const std::vector<uint8_t> bytes, writer.add(source.time_s(i), frame.tiles));
    VOXELD_TRY(file.append(bytes));
  }
  VOXELD_ASSIGN(const SequenceWriter::End end, writer.finish());
  VOXELD_TRY(file.append(end.index));
  return file.replace(0, end.header);
}

}  // namespace voxeld
