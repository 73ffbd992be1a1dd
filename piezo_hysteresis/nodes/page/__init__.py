"""The process of the live page: it subscribes and calls services, and publishes nothing."""
