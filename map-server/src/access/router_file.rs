//! A router's configuration, as it is looked at.

use serde_json::Value;
use zenoh::Config;

/// A router's configuration, by its file.
#[derive(Debug)]
pub struct RouterFile {
    /// What it is called in sentences.
    pub name: String,
    /// What it says, with Zenoh's defaults.
    pub config: Config,
}

impl RouterFile {
    pub(super) fn get(&self, key: &str) -> Value {
        let json = self.config.get_json(key).unwrap_or_default();
        serde_json::from_str(&json).unwrap_or_default()
    }

    pub(super) fn id(&self) -> Option<String> {
        self.get("id").as_str().map(str::to_owned)
    }

    /// The texts of endpoints: a list, or one for each mode.
    pub(super) fn endpoints(&self, key: &str) -> Vec<String> {
        let found = self.get(key);
        let lists = match &found {
            Value::Object(by_mode) => by_mode.get("router").into_iter().collect(),
            list => vec![list],
        };
        let texts = lists.into_iter().flat_map(|list| list.as_array().into_iter().flatten());
        texts.filter_map(|text| text.as_str().map(str::to_owned)).collect()
    }
}
