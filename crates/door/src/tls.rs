//! Certificates of this side, and of those who come.

use crate::error::DoorError;
use rustls::RootCertStore;
use rustls::crypto::ring::default_provider;
use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, PrivateKeyDer};
use rustls::server::WebPkiClientVerifier;
use std::net::IpAddr;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tokio_rustls::TlsAcceptor;
use x509_parser::certificate::BasicExtension;
use x509_parser::extensions::{ExtendedKeyUsage, GeneralName};

/// Files in PEM form.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DoorCertificates {
    /// What this side shows.
    pub certificate: PathBuf,
    /// Its key.
    pub key: PathBuf,
    /// Who has signed the certificates of those who are let in.
    pub authority: PathBuf,
}

/// Takes TLS connections; and the names that the own certificate has.
pub(crate) struct SecureSide {
    pub(crate) acceptor: TlsAcceptor,
    pub(crate) names: Vec<String>,
}

fn of_no_use(what: &'static str, file: &Path, reason: impl ToString) -> DoorError {
    DoorError::File { what, file: file.to_owned(), reason: reason.to_string() }
}

fn certificates(what: &'static str, file: &Path) -> Result<Vec<CertificateDer<'static>>, DoorError> {
    let read = CertificateDer::pem_file_iter(file).and_then(Iterator::collect::<Result<Vec<_>, _>>);
    let read = read.map_err(|error| of_no_use(what, file, error))?;
    if read.is_empty() { Err(of_no_use(what, file, "it holds no certificate in PEM form")) } else { Ok(read) }
}

/// Reads the files.
///
/// # Errors
/// [`DoorError::File`], [`DoorError::Tls`].
pub(crate) fn secure(files: &DoorCertificates) -> Result<SecureSide, DoorError> {
    let chain = certificates("certificate", &files.certificate)?;
    let key = PrivateKeyDer::from_pem_file(&files.key).map_err(|error| of_no_use("key", &files.key, error))?;
    let mut roots = RootCertStore::empty();
    for authority in certificates("authority", &files.authority)? {
        roots.add(authority).map_err(|error| of_no_use("authority", &files.authority, error))?;
    }
    check_purpose(&chain[0]).map_err(|reason| of_no_use("certificate", &files.certificate, reason))?;
    let names = names_in(&chain[0]);
    let failed = |error: rustls::Error| DoorError::Tls(error.to_string());
    let provider = Arc::new(default_provider());
    // Who shows none is told so in the protocol that is spoken inside.
    let verifier = WebPkiClientVerifier::builder_with_provider(Arc::new(roots), Arc::clone(&provider))
        .allow_unauthenticated()
        .build()
        .map_err(|error| DoorError::Tls(error.to_string()))?;
    let mut config = rustls::ServerConfig::builder_with_provider(provider)
        .with_safe_default_protocol_versions()
        .map_err(failed)?
        .with_client_cert_verifier(verifier)
        .with_single_cert(chain, key)
        .map_err(failed)?;
    config.alpn_protocols = vec![b"http/1.1".to_vec()];
    Ok(SecureSide { acceptor: TlsAcceptor::from(Arc::new(config)), names })
}

/// Checks that a certificate is one to listen with, and warns if nobody takes it now.
fn check_purpose(certificate: &CertificateDer<'_>) -> Result<(), String> {
    let Ok((_, certificate)) = x509_parser::parse_x509_certificate(certificate) else { return Ok(()) };
    let is_for_servers = |usage: BasicExtension<&ExtendedKeyUsage<'_>>| usage.value.server_auth || usage.value.any;
    if !certificate.extended_key_usage().ok().flatten().is_none_or(is_for_servers) {
        return Err("it is made to connect with, and nobody takes it from who listens: make one with the names of \
                    this host"
            .to_owned());
    }
    let validity = certificate.validity();
    if !validity.is_valid() {
        let (from, to) = (validity.not_before, validity.not_after);
        tracing::warn!(
            "the certificate is valid from {from} to {to}, and by this machine's clock that is not now: nobody takes it"
        );
    }
    Ok(())
}

/// The hosts that a certificate is for.
fn names_in(certificate: &CertificateDer<'_>) -> Vec<String> {
    let Ok((_, certificate)) = x509_parser::parse_x509_certificate(certificate) else { return Vec::new() };
    let Ok(Some(names)) = certificate.subject_alternative_name() else { return Vec::new() };
    let name = |name: &GeneralName<'_>| match name {
        GeneralName::DNSName(name) => Some((*name).to_owned()),
        GeneralName::IPAddress(bytes) => match bytes.len() {
            4 => <[u8; 4]>::try_from(*bytes).ok().map(|bytes| IpAddr::from(bytes).to_string()),
            _ => <[u8; 16]>::try_from(*bytes).ok().map(|bytes| format!("[{}]", IpAddr::from(bytes))),
        },
        _ => None,
    };
    names.value.general_names.iter().filter_map(name).collect()
}
