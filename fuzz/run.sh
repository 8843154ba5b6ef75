#!/usr/bin/env bash
# Fuzzes every target but those of the server, or those named, for so many seconds each:
#   fuzz/run.sh SECONDS [TARGET…]
# With 0 seconds they are only built.
#
# As cargo fuzz does, but with a stable compiler and without a sanitizer: there is no unsafe code to
# watch, and what counts are panics, overflows, memory and time. `cargo fuzz run TARGET` works as
# well.
#
# It begins with the inputs of corpus/: TARGET/seed-*, made by `cargo run --example seeds`, and
# TARGET.tar.gz, found by longer runs, one for each thing that they reach. New inputs go to
# target/corpus, findings to artifacts.
set -euo pipefail
cd "$(dirname "$0")"

# These need a build of Zenoh, and are fuzzed when they are named.
of_server="quotas|rescue|roles"
seconds=${1:?seconds for each target}
shift
if [ "$#" -gt 0 ]; then
    targets=("$@")
else
    mapfile -t targets < <(basename -s .rs -a fuzz_targets/*.rs | grep -vxE "$of_server")
fi
features=()
for target in "${targets[@]}"; do
    if [[ $target =~ ^($of_server)$ ]]; then features=(--features server); fi
done

export RUSTFLAGS="-Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 -Cllvm-args=-sanitizer-coverage-inline-8bit-counters \
-Cllvm-args=-sanitizer-coverage-pc-table -Cllvm-args=-sanitizer-coverage-trace-compares --cfg fuzzing -Cdebug-assertions -Ccodegen-units=1"
host=$(rustc -vV | sed -n 's/^host: //p')
cargo build --release --bins --target "$host" "${features[@]}"
if [ "$seconds" = 0 ]; then exit 0; fi

for target in "${targets[@]}"; do
    mkdir -p "target/corpus/$target" "artifacts/$target"
    if [ -f "corpus/$target.tar.gz" ]; then
        tar -xzf "corpus/$target.tar.gz" -C "target/corpus/$target" --skip-old-files
    fi
    echo "fuzzing $target for $seconds s"
    log="target/$target.log"
    if ! "target/$host/release/$target" -max_total_time="$seconds" -timeout=20 -rss_limit_mb=2048 -print_final_stats=1 \
        -artifact_prefix="artifacts/$target/" "target/corpus/$target" "corpus/$target" >"$log" 2>&1; then
        tail -n 40 "$log"
        echo "$target: found something, see fuzz/artifacts/$target" >&2
        exit 1
    fi
    sed -n 's/^stat::number_of_executed_units: */  inputs tried: /p' "$log"
done
