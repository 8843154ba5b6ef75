//! A node: who one is on the graph, and who else is there.

use crate::error::RosError;
use crate::keys::{
    Endpoint, EndpointKind, KeyForm, NodeIdentity, data_key, endpoint_token, endpoint_tokens, node_token, parse_token,
    session_of,
};
use crate::names::{namespace, resolve};
use crate::qos::Qos;
use fht_ros_messages::{Distribution, type_hash};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;
use zenoh::Session;
use zenoh::liveliness::LivelinessToken;

/// Counts nodes and endpoints; unique in this process, and so in each of its sessions.
static NEXT_ID: AtomicU64 = AtomicU64::new(0);

/// Who a node is.
#[derive(Clone, Debug)]
pub struct NodeConfig {
    /// Its name, such as `mapper`.
    pub name: String,
    /// Its namespace: names without a leading slash are in it. Default none.
    pub namespace: String,
    /// `ROS_DOMAIN_ID`. Default 0.
    pub domain: u32,
    /// How the graph maps names to keys. Default that of `rmw_zenoh`.
    pub form: KeyForm,
    /// Which hashes the graph's nodes write. Default Jazzy.
    pub distribution: Distribution,
}

impl NodeConfig {
    /// A node of this name, with the defaults.
    #[must_use]
    pub fn new(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            namespace: String::new(),
            domain: 0,
            form: KeyForm::default(),
            distribution: Distribution::default(),
        }
    }
}

/// A node on a graph. It is there until it and all that it made are dropped.
#[derive(Clone)]
pub struct RosNode {
    inner: Arc<Inner>,
}

struct Inner {
    session: Session,
    config: NodeConfig,
    identity: NodeIdentity,
    _token: Option<LivelinessToken>,
}

/// What an endpoint is made of: its key, and the token that says it is there.
pub(crate) struct Declared {
    /// The full name.
    pub(crate) name: String,
    /// Where it sends; with the type's hash.
    pub(crate) key: String,
    /// The same for any hash, for who listens: other distributions hash otherwise.
    pub(crate) any_key: String,
    /// The token's text.
    pub(crate) token: String,
    _token: Option<LivelinessToken>,
}

impl RosNode {
    /// Joins the graph behind `session`: a client of the robot's router. A robot's `rmw_zenohd`
    /// does not pass on what peers say, so the session must not be a peer's.
    ///
    /// # Errors
    /// [`RosError`] when the name cannot be one, or the session is closed.
    pub async fn join(session: Session, config: NodeConfig) -> Result<Self, RosError> {
        let namespace = namespace(&config.namespace)?;
        resolve(&config.name, &namespace, "node")?;
        let identity = NodeIdentity {
            domain: config.domain,
            zid: session.zid().to_string(),
            node_id: NEXT_ID.fetch_add(1, Ordering::Relaxed),
            namespace: format!("/{namespace}"),
            name: config.name.clone(),
        };
        let token = match config.form {
            KeyForm::Rmw => Some(declare_token(&session, &node_token(&identity)).await?),
            // Bridges' tokens are between bridges.
            KeyForm::Bridge => None,
        };
        Ok(Self { inner: Arc::new(Inner { session, config, identity, _token: token }) })
    }

    /// Who the node is.
    #[must_use]
    pub fn config(&self) -> &NodeConfig {
        &self.inner.config
    }

    /// Whether a router or another session is there.
    pub async fn is_connected(&self) -> bool {
        let info = self.inner.session.info();
        info.routers_zid().await.next().is_some() || info.peers_zid().await.next().is_some()
    }

    pub(crate) fn session(&self) -> &Session {
        &self.inner.session
    }

    /// The full name of a topic or service.
    ///
    /// # Errors
    /// [`RosError::Name`].
    pub fn resolve(&self, name: &str) -> Result<String, RosError> {
        Ok(resolve(name, &self.inner.config.namespace, &self.inner.config.name)?)
    }

    pub(crate) async fn declare(
        &self,
        kind: EndpointKind,
        name: &str,
        ros_type: &str,
        qos: Qos,
    ) -> Result<Declared, RosError> {
        let Inner { session, config, identity, .. } = &*self.inner;
        let name = self.resolve(name)?;
        let hash = type_hash(ros_type, config.distribution).ok_or_else(|| RosError::Type(ros_type.to_owned()))?;
        let key = data_key(config.form, config.domain, &name, ros_type, &hash);
        let any_key = data_key(config.form, config.domain, &name, ros_type, "*");
        let endpoint =
            Endpoint { kind, name: name.clone(), ros_type: ros_type.to_owned(), hash, qos, node: config.name.clone() };
        let token = endpoint_token(identity, NEXT_ID.fetch_add(1, Ordering::Relaxed), &endpoint);
        let declared = match config.form {
            KeyForm::Rmw => Some(declare_token(session, &token).await?),
            KeyForm::Bridge => None,
        };
        Ok(Declared { name, key, any_key, token, _token: declared })
    }

    /// All endpoints on the graph: those of other nodes, and the own ones. Sorted by name; waits at
    /// most `patience` for routers to tell.
    ///
    /// # Errors
    /// [`RosError::Zenoh`] when the session is closed.
    pub async fn endpoints(&self, patience: Duration) -> Result<Vec<Endpoint>, RosError> {
        self.list(patience, |_| true).await
    }

    /// The same without those of this node's own session: also nodes of the same name, if they are
    /// others' programs.
    ///
    /// # Errors
    /// [`RosError::Zenoh`] when the session is closed.
    pub async fn others(&self, patience: Duration) -> Result<Vec<Endpoint>, RosError> {
        let own = self.inner.identity.zid.as_str();
        self.list(patience, |token| session_of(token) != Some(own)).await
    }

    /// The endpoints whose tokens are meant.
    async fn list(&self, patience: Duration, is_meant: impl Fn(&str) -> bool) -> Result<Vec<Endpoint>, RosError> {
        let config = &self.inner.config;
        let tokens = endpoint_tokens(config.form, config.domain);
        let failed = RosError::zenoh("list who is on the graph");
        let replies = self.session().liveliness().get(tokens).timeout(patience).await.map_err(failed)?;
        let mut endpoints = Vec::new();
        while let Ok(reply) = replies.recv_async().await {
            if let Ok(sample) = reply.result() {
                let token = sample.key_expr().as_str();
                endpoints.extend(parse_token(token).filter(|_| is_meant(token)));
            }
        }
        endpoints.sort_by(|a, b| (&a.name, a.kind, &a.node).cmp(&(&b.name, b.kind, &b.node)));
        Ok(endpoints)
    }
}

async fn declare_token(session: &Session, token: &str) -> Result<LivelinessToken, RosError> {
    session.liveliness().declare_token(token).await.map_err(RosError::zenoh(format!("declare the token {token}")))
}

/// Nanoseconds since the epoch.
pub(crate) fn now_ns() -> i64 {
    let since = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_nanos()).unwrap_or(i64::MAX)
}
