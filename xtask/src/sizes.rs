//! How long functions and files are, and how much code is shipped.

use crate::Report;
use crate::source::{Source, is_for_tests};
use std::collections::BTreeSet;
use syn::spanned::Spanned;
use syn::visit::{self, Visit};

/// Lines of a function, at most.
const FUNCTION_LINES: usize = 80;
/// Lines of a file beyond which it is told.
const FILE_LINES: usize = 400;

struct Functions {
    found: Vec<(String, usize, usize)>,
}

impl Functions {
    fn note(&mut self, name: &syn::Ident, whole: proc_macro2::Span) {
        let (first, last) = (whole.start().line, whole.end().line);
        self.found.push((name.to_string(), first, last - first + 1));
    }
}

impl<'ast> Visit<'ast> for Functions {
    fn visit_item_fn(&mut self, item: &'ast syn::ItemFn) {
        self.note(&item.sig.ident, item.sig.span().join(item.block.span()).unwrap_or_else(|| item.block.span()));
        visit::visit_item_fn(self, item);
    }
    fn visit_impl_item_fn(&mut self, item: &'ast syn::ImplItemFn) {
        self.note(&item.sig.ident, item.sig.span().join(item.block.span()).unwrap_or_else(|| item.block.span()));
        visit::visit_impl_item_fn(self, item);
    }
    fn visit_trait_item_fn(&mut self, item: &'ast syn::TraitItemFn) {
        self.note(&item.sig.ident, item.span());
        visit::visit_trait_item_fn(self, item);
    }
}

/// Functions that are too long, tests included.
pub(crate) fn functions(sources: &[Source]) -> Report {
    let mut findings = Vec::new();
    for source in sources {
        let mut functions = Functions { found: Vec::new() };
        functions.visit_file(&source.syntax);
        let long = functions.found.into_iter().filter(|(_, _, lines)| *lines > FUNCTION_LINES);
        findings.extend(long.map(|(name, line, lines)| format!("{}:{line} {name}: {lines} lines", source.path)));
    }
    Report { title: "functions over 80 lines", findings, is_rule: true }
}

/// Files that are long.
pub(crate) fn files(sources: &[Source]) -> Report {
    let lines = |source: &Source| source.text.lines().count();
    let long = sources.iter().filter(|source| lines(source) > FILE_LINES);
    let findings = long.map(|source| format!("{}: {} lines", source.path, lines(source))).collect();
    Report { title: "files over 400 lines", findings, is_rule: false }
}

/// Lines of code that ship: of libraries and programs, without tests, comments and blank lines.
pub(crate) fn shipped(sources: &[Source]) -> usize {
    let ships = |source: &&Source| {
        source.in_crate().is_some() && !source.is_test() && !source.path.starts_with("tests/") && !is_tool(source)
    };
    sources.iter().filter(ships).map(code_lines).sum()
}

fn is_tool(source: &Source) -> bool {
    ["demo/", "eval/", "xtask/"].iter().any(|folder| source.path.starts_with(folder))
}

fn code_lines(source: &Source) -> usize {
    let mut of_tests = BTreeSet::new();
    for item in &source.syntax.items {
        if let syn::Item::Mod(module) = item
            && is_for_tests(&module.attrs)
        {
            of_tests.extend(module.span().start().line..=module.span().end().line);
        }
    }
    let is_code = |(number, line): &(usize, &str)| {
        let line = line.trim();
        !line.is_empty() && !line.starts_with("//") && !of_tests.contains(&(number + 1))
    };
    source.text.lines().enumerate().filter(is_code).count()
}
