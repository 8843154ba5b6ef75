# Everyday commands. `just` lists them; each is one line that you can also type yourself.

shared := "../shared/data"

# Lists the recipes.
default:
    @just --list

# The demo: server, explorer and client as three processes. Example: just demo --world office
demo *args:
    cargo run --release --bin handoff -- {{args}}

# The demo, with the server left running to ask the map.
serve *args:
    cargo run --release --bin handoff -- --keep {{args}}

# All programs.
build:
    cargo build --release --workspace

# Tests: of all crates, or of one with its arguments. Example: just test -p fht-map
test *args="--workspace":
    cargo test --release {{args}}

# Format, lints, and the rules of the house.
lint:
    cargo fmt --all --check
    cargo clippy --release --workspace --all-targets -- -D warnings
    cargo clippy --release -p fht-descriptor --features tract -- -D warnings
    cargo xtask house

# Arrows between crates, circles of modules, names, sizes, prose, the paper's map.
house *args:
    cargo xtask house {{args}}

# The documentation of all crates. Example: just doc --open
doc *args:
    cargo doc --workspace --no-deps {{args}}

# Fuzzes every target, or those named, for so many seconds each. Example: just fuzz 60 increment
fuzz seconds="10" *targets:
    fuzz/run.sh {{seconds}} {{targets}}

# Benchmarks: all, or one of paths, path_queries, appearance, descriptor, mapping, relocalize.
bench name="":
    cargo bench -p fht-eval {{ if name == "" { "" } else { "--bench " + name } }}

# The paper's tables with our figures (hours; goes on where it stopped).
tables:
    cargo run --release --bin evaluate -- tables --out docs/results/tables.md --worlds {{shared}}/maps/museum.yaml,{{shared}}/maps/large_indoor.yaml,{{shared}}/worlds/hospital/worlds/hospital.world

# Simulated fleets on a bad network.
simulate seeds="2000" *args:
    cargo run --release --bin simulate -- --seeds {{seeds}} {{args}}

# A site of three routers and three servers, killed again and again under load.
site *args:
    cargo run --release --bin site -- {{args}}

# Everything that a change must pass.
ci:
    .ci/run
