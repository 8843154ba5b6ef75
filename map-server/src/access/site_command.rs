//! `map-server check-site`: the routers' configurations on the command line.

use crate::access::router_file::RouterFile;
use crate::access::site_check::{openings, others_not_given};
use clap::Args;
use fht_program::print_line;
use fht_session::{ConfigurationError, read_config};
use std::path::PathBuf;

/// Says what leaves a site open: reads the Zenoh configurations of its routers.
#[derive(Debug, Args)]
#[command(after_long_help = EXAMPLES)]
pub(crate) struct SiteArgs {
    /// The configurations of all routers of the site (JSON5), as zenohd -c or map-server
    /// --zenoh-config gets them.
    #[arg(required = true, value_name = "CONFIG.json5")]
    configs: Vec<PathBuf>,
}

const EXAMPLES: &str = "\
Examples:
  map-server check-site zenohd-a.json5 zenohd-b.json5 zenohd-c.json5
      a site with three routers; what it says is explained in deploy/README.md
  map-server check-site alone.json5
      a map-server that is the only router

Exit code 0: nothing; 1: something, a line each, or not all routers are given; 2: a file cannot be
used.";

/// Why a site is not fine.
#[derive(Debug, thiserror::Error)]
pub(crate) enum SiteCommandError {
    /// A file is no configuration.
    #[error(transparent)]
    Configuration(#[from] ConfigurationError),
    /// Something is open.
    #[error("{0} thing(s) leave the site open")]
    Open(usize),
    /// What is between routers was not looked at.
    #[error("the configurations of the other routers are not given: whether the site is open is not known")]
    NotAll,
}

impl SiteCommandError {
    /// Whether what was given is wrong.
    pub(crate) fn is_input(&self) -> bool {
        matches!(self, Self::Configuration(_))
    }
}

impl SiteArgs {
    /// Prints what is open.
    ///
    /// # Errors
    /// [`SiteCommandError`]; also when something is.
    pub(crate) fn run(&self) -> Result<(), SiteCommandError> {
        let read = |file: &PathBuf| {
            let config = read_config(Some(file))?;
            Ok::<_, ConfigurationError>(RouterFile { name: file.display().to_string(), config })
        };
        let routers: Vec<RouterFile> = self.configs.iter().map(read).collect::<Result<_, _>>()?;
        let found = openings(&routers);
        let others = others_not_given(&routers);
        for text in found.iter().chain(&others) {
            print_line!("{text}");
        }
        match (found.len(), others) {
            (0, None) => {
                print_line!("{} router(s): nothing is open", routers.len());
                Ok(())
            }
            (0, Some(_)) => Err(SiteCommandError::NotAll),
            (count, _) => Err(SiteCommandError::Open(count)),
        }
    }
}
