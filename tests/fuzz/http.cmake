voxeld_fuzzer(http_head http_head.cpp voxeld_http)
voxeld_fuzzer(http_body http_body.cpp voxeld_http)
voxeld_fuzzer(http_coding http_coding.cpp voxeld_http)
voxeld_fuzzer(http_links http_links.cpp voxeld_api)
