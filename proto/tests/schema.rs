//! The schemas in `docs/schema/` are those of the types. `FHT_WRITE_SCHEMAS=1 cargo test -p
//! fht-proto --features schema --test schema` writes them.

use std::path::Path;

#[test]
fn the_schemas_in_the_documents_are_those_of_the_types() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/schema");
    let is_to_write = std::env::var_os("FHT_WRITE_SCHEMAS").is_some();
    let mut names = Vec::new();
    for (name, schema) in fht_proto::schema::schemas() {
        let file = folder.join(format!("{name}.json"));
        let text = serde_json::to_string_pretty(&schema).expect("a schema is JSON") + "\n";
        if is_to_write {
            std::fs::write(&file, &text).expect("the folder is there");
        }
        let written = std::fs::read_to_string(&file).unwrap_or_default();
        assert!(written == text, "{} is not what the types say: see the head of {}", file.display(), file!());
        names.push(format!("{name}.json"));
    }
    let mut files: Vec<String> = std::fs::read_dir(&folder)
        .expect("the folder is there")
        .map(|entry| entry.expect("it is readable").file_name().to_string_lossy().into_owned())
        .collect();
    files.sort();
    names.sort();
    assert_eq!(files, names, "files without a type, or the other way round");
}
