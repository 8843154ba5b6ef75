//! The machines of a site: routers and servers as processes, killed as by a power cut.

use crate::site::config::SiteConfig;
use crate::site::report::SiteError;
use crate::site::secured::Secured;
use crate::site::sessions::rotated;
use fht_demo::{Process, Role, free_endpoint};
use serde_json::{Value, json};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

/// How long a router may take to listen.
const PATIENCE: Duration = Duration::from_secs(30);

/// The storages of `deploy/`.
const STORAGES: &str = include_str!("../../../deploy/storages.json5");

/// The storages of `deploy/` with a volume in memory.
fn storages() -> Result<Value, SiteError> {
    let unreadable = |error: json5::Error| SiteError::Late(format!("storages.json5: {error}"));
    let mut storages: Value = json5::from_str::<Value>(STORAGES).map_err(unreadable)?["plugins"].take();
    let manager = &mut storages["storage_manager"];
    manager["volumes"] = json!({});
    manager["storages"]["increments"]["volume"] = "memory".into();
    Ok(storages)
}

/// The configuration that `deploy/` gives zenohd, but without TLS.
fn router() -> Result<String, SiteError> {
    let config = json!({
        "mode": "router",
        "connect": { "timeout_ms": -1, "exit_on_failure": false, "retry": { "period_init_ms": 100, "period_max_ms": 1000 } },
        "scouting": { "multicast": { "enabled": false } },
        "timestamping": { "enabled": true },
        "plugins": storages()?,
    });
    Ok(config.to_string())
}

/// The processes.
pub(super) struct Machines {
    executable: PathBuf,
    /// One for each router.
    configurations: Vec<PathBuf>,
    secured: Option<Arc<Secured>>,
    endpoints: Vec<String>,
    /// None while it is down.
    routers: Vec<Option<Process>>,
    servers: Vec<Option<Process>>,
    storages: usize,
}

impl Machines {
    pub(super) fn start(config: &SiteConfig, secured: Option<Arc<Secured>>) -> Result<Self, SiteError> {
        let protocol = if secured.is_some() { "tls/" } else { "tcp/" };
        let endpoint = || free_endpoint().map(|endpoint| endpoint.replace("tcp/", protocol));
        let endpoints: Vec<String> = (0..config.routers).map(|_| endpoint()).collect::<Result<_, _>>()?;
        let configuration = |(index, endpoint): (usize, &String)| match &secured {
            Some(site) => site.router(index, endpoint, storages()?),
            None => {
                let file = config.folder.join("router.json5");
                std::fs::write(&file, router()?)?;
                Ok(file)
            }
        };
        let configurations = endpoints.iter().enumerate().map(configuration).collect::<Result<_, SiteError>>()?;
        let mut machines = Self {
            executable: config.executable.clone(),
            configurations,
            secured,
            endpoints,
            routers: Vec::new(),
            servers: Vec::new(),
            storages: config.routers,
        };
        for index in 0..config.routers {
            let router = machines.router(index)?;
            machines.routers.push(Some(router));
        }
        for (router, endpoint) in machines.routers.iter_mut().flatten().zip(&machines.endpoints) {
            router.wait_until_listening(&endpoint.replace("tls/", "tcp/"), PATIENCE)?;
        }
        for index in 0..config.servers {
            let server = machines.server(index)?;
            machines.servers.push(Some(server));
        }
        Ok(machines)
    }

    /// Where the routers listen.
    pub(super) fn endpoints(&self) -> &[String] {
        &self.endpoints
    }

    fn router(&self, index: usize) -> Result<Process, SiteError> {
        let mut args = vec!["-c".to_owned(), self.configurations[index].display().to_string()];
        for (other, endpoint) in self.endpoints.iter().enumerate() {
            args.extend([if other == index { "-l" } else { "-e" }.to_owned(), endpoint.clone()]);
        }
        Ok(Process::start(&self.executable, crate::router::NAME, args)?)
    }

    /// Each server has another router first.
    fn server(&self, index: usize) -> Result<Process, SiteError> {
        let mut args = vec!["--storages".to_owned(), self.storages.to_string()];
        let endpoints = rotated(&self.endpoints, index);
        if let Some(site) = &self.secured {
            let file = site.credentials.session("server", &format!("maps-{index}"), &endpoints)?;
            let files = [("--zenoh-config", file), ("--roles", site.roles_file())];
            args.extend(files.into_iter().flat_map(|(option, file)| [option.to_owned(), file.display().to_string()]));
        } else {
            args.extend(endpoints.into_iter().flat_map(|endpoint| ["--connect".to_owned(), endpoint]));
        }
        Ok(Process::start(&self.executable, Role::MapServer, args)?)
    }

    /// Kills a router and a server.
    pub(super) fn kill(&mut self, router: usize, server: usize) -> Result<(), SiteError> {
        for process in [&mut self.routers[router], &mut self.servers[server]] {
            if let Some(mut process) = process.take() {
                process.kill()?;
            }
        }
        Ok(())
    }

    /// Starts a router and a server that were killed.
    pub(super) fn start_again(&mut self, router: usize, server: usize) -> Result<(), SiteError> {
        self.routers[router] = Some(self.router(router)?);
        self.servers[server] = Some(self.server(server)?);
        Ok(())
    }

    /// Kills all servers and starts them, so that they have only what the storages keep.
    pub(super) fn begin_anew(&mut self) -> Result<(), SiteError> {
        for server in self.servers.iter_mut().flatten() {
            server.kill()?;
        }
        for index in 0..self.servers.len() {
            self.servers[index] = Some(self.server(index)?);
        }
        Ok(())
    }
}
