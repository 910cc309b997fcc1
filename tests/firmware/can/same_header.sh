#!/bin/sh
# same_header.sh PYTHON PROJECT DBC HEADER [NAMESPACE]: the committed header is what the generator makes of the DBC.
set -eu
python=$1 project=$2 dbc=$3 header=$4
shift 4
made=$(mktemp)
trap 'rm -f "$made"' EXIT
rm "$made"
"$python" -B "$project/cmake/dbc_header.py" "$project/firmware/can/$dbc.dbc" "$made" "$@"
diff "$project/firmware/can/generated/$header.hpp" "$made"
