"""What every modal operator needs."""
