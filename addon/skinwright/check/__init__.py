"""What is wrong with weights, in numbers and in test poses."""
