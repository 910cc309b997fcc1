# mbed TLS 2.28 (long-term support) from Debian's source package, which apt checks by its signature: unpacked in
# BMS_MBEDTLS, by default build/mbedtls, when a build first needs it. The few sources that the loader uses are compiled
# with firmware/boot/mbedtls/loader_config.h.
#
#   bms_mbedtls_sources(LIST)   fetches the sources if they are missing and sets LIST to those that the loader needs
set(BMS_MBEDTLS ${PROJECT_SOURCE_DIR}/build/mbedtls CACHE PATH "unpacked source of mbed TLS 2.28")

function(bms_mbedtls_sources list)
  if(NOT EXISTS ${BMS_MBEDTLS}/library/ecdsa.c)
    execute_process(COMMAND ${PROJECT_SOURCE_DIR}/cmake/mbedtls.sh ${BMS_MBEDTLS} RESULT_VARIABLE failed)
    if(failed)
      message(FATAL_ERROR "mbed TLS could not be fetched; -DBMS_MBEDTLS=FOLDER names an unpacked source of 2.28")
    endif()
  endif()
  set(names asn1parse asn1write bignum constant_time ecdsa ecp ecp_curves memory_buffer_alloc platform platform_util
    sha256)
  list(TRANSFORM names PREPEND ${BMS_MBEDTLS}/library/)
  list(TRANSFORM names APPEND .c)
  set(${list} ${names} PARENT_SCOPE)
endfunction()

# bms_mbedtls(TARGET TYPE): the library with its configuration
function(bms_mbedtls target type)
  bms_mbedtls_sources(sources)
  add_library(${target} ${type} ${sources})
  target_include_directories(${target} SYSTEM PUBLIC ${BMS_MBEDTLS}/include)
  target_include_directories(${target} PUBLIC ${PROJECT_SOURCE_DIR}/firmware/boot/mbedtls)
  target_compile_definitions(${target} PUBLIC MBEDTLS_CONFIG_FILE="loader_config.h")
  target_compile_options(${target} PRIVATE -w -std=gnu11)  # warnings are upstream's
endfunction()
