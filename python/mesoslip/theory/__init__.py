"""What theory says of a configuration, without simulating it."""
