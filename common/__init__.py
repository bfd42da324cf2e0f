"""The wire contract and the runtime that every service stands on."""

CONTRACT_VERSION = 1
