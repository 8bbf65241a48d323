# Seeds: voxeld_make_fixtures DIR, then fuzz_gltf with DIR as its corpus.
voxeld_fuzzer(gltf gltf_scene.cpp voxeld_scene)
voxeld_fuzzer(gltf_streams gltf_streams.cpp voxeld_scene_gltf)
voxeld_fuzzer(gltf_values gltf_values.cpp voxeld_scene nlohmann_json::nlohmann_json)
voxeld_fuzzer(image gltf_image.cpp voxeld_scene)
voxeld_fuzzer(gltf_animation gltf_animation.cpp voxeld_scene nlohmann_json::nlohmann_json)
