foreach(format 3mf obj off ply stl zip md5)
  voxeld_fuzzer(scene_${format} scene_${format}.cpp voxeld_scene)
endforeach()
voxeld_fuzzer(scene_md5_animation scene_md5_animation.cpp voxeld_scene ZLIB::ZLIB)
