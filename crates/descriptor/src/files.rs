//! The files of a model: built in, or next to each other in a folder.

use crate::error::DescriptorError;
use std::borrow::Cow;
use std::path::{Path, PathBuf};

/// The built-in model; see `models/README.md` for its origin and licence.
pub(crate) const BUILT_IN_ONNX: &[u8] = include_bytes!("../../../models/mobilenet-v2-b11.onnx");
pub(crate) const BUILT_IN_DESCRIPTION: &str = include_str!("../../../models/mobilenet-v2-b11.json");
pub(crate) const BUILT_IN_PROJECTION: &[u8] = include_bytes!("../../../models/mobilenet-v2-b11.projection");

/// A file and its contents.
pub(crate) struct File<T> {
    pub path: PathBuf,
    pub contents: T,
}

/// The files of a model.
pub(crate) struct ModelFiles<'a> {
    pub onnx: File<Cow<'a, [u8]>>,
    pub description: File<Cow<'a, str>>,
    /// The built-in model's projection; those of other models lie next to the description.
    projection: Option<&'a [u8]>,
}

impl ModelFiles<'_> {
    /// The projection that the description names.
    pub fn projection(&self, name: &str) -> Result<File<Cow<'_, [u8]>>, DescriptorError> {
        let path = self.description.path.with_file_name(name);
        let contents = match self.projection {
            Some(bytes) => Cow::Borrowed(bytes),
            None => Cow::Owned(std::fs::read(&path).map_err(read_error(&path))?),
        };
        Ok(File { path, contents })
    }
}

pub(crate) fn built_in() -> ModelFiles<'static> {
    let path = PathBuf::from("built-in model");
    ModelFiles {
        onnx: File { path: path.clone(), contents: Cow::Borrowed(BUILT_IN_ONNX) },
        description: File { path, contents: Cow::Borrowed(BUILT_IN_DESCRIPTION) },
        projection: Some(BUILT_IN_PROJECTION),
    }
}

/// The ONNX file `onnx` and the description next to it with the extension `.json`.
pub(crate) fn read(onnx: &Path) -> Result<ModelFiles<'static>, DescriptorError> {
    let description = onnx.with_extension("json");
    let bytes = std::fs::read(onnx).map_err(read_error(onnx))?;
    let text = std::fs::read_to_string(&description).map_err(read_error(&description))?;
    Ok(ModelFiles {
        onnx: File { path: onnx.to_owned(), contents: Cow::Owned(bytes) },
        description: File { path: description, contents: Cow::Owned(text) },
        projection: None,
    })
}

fn read_error(path: &Path) -> impl FnOnce(std::io::Error) -> DescriptorError {
    let path = path.to_owned();
    move |source| DescriptorError::Read { path, source }
}
