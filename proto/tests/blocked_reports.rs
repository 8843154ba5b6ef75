//! What a report of a blocked way may say.

use fht_proto::api::fleet::BlockedReport;

fn parse(text: &str) -> Result<BlockedReport, String> {
    serde_json::from_str(text).map_err(|error| error.to_string())
}

#[test]
fn a_misspelt_field_is_refused_and_takes_nothing_back() {
    for text in [r#"{"for_s": 30, "place": [[1, 2]]}"#, r#"{"for_s": 30, "places": [], "edge": []}"#] {
        let refusal = parse(text).err().unwrap_or_default();
        assert!(refusal.contains("unknown field") && refusal.contains("`places`"), "{text}: {refusal}");
    }
}

#[test]
fn a_report_without_edges_and_places_takes_back() {
    for text in [r#"{"for_s": 30}"#, r#"{"for_s": 30, "edges": [], "places": []}"#] {
        let expected = BlockedReport { for_s: 30.0, ..BlockedReport::default() };
        assert_eq!(parse(text), Ok(expected), "{text}");
    }
}
