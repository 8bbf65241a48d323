voxeld_fuzzer(options proto_options.cpp voxeld_proto voxeld_base)
voxeld_fuzzer(json proto_json.cpp voxeld_proto voxeld_base)
voxeld_fuzzer(task_api proto_task_api.cpp voxeld_proto voxeld_base)
voxeld_fuzzer(small proto_small.cpp voxeld_proto voxeld_base)
