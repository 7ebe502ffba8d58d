"""The Delta robot as a closed-chain mechanism: equations (50)-(83) of the paper."""
