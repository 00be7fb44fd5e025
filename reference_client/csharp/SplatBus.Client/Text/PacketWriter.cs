// SPDX-License-Identifier: MIT
using System;

namespace SplatBus
{
    /// <summary>
    /// Writes one packet after the other into one buffer [FRM-1, JSN-1]: commas and the length are
    /// its own affair, and it allocates only for a packet that is longer than every one before it.
    /// </summary>
    public sealed class PacketWriter
    {
        byte[] buffer = new byte[512];
        int at;
        bool comma;

        /// <summary>Begin a packet, whose payload is an object.</summary>
        public void Begin()
        {
            at = Framing.HeaderBytes;
            comma = false;
            BeginObject();
        }

        /// <summary>End it.</summary>
        /// <returns>The packet; valid until the next one begins.</returns>
        /// <exception cref="ProtocolException">It is longer than a packet may be [FRM-2].</exception>
        public ArraySegment<byte> End()
        {
            EndObject();
            int length = at - Framing.HeaderBytes;
            if (length > Limits.MaxPayloadBytes) throw new ProtocolException("a payload of " + length + " bytes [FRM-2]", Limits.MaxPayloadBytes);
            for (int i = 0; i < Framing.HeaderBytes; i++) buffer[i] = (byte)(length >> 8 * i);
            return new ArraySegment<byte>(buffer, 0, at);
        }

        /// <summary>Begin a member. No name may stand twice in an object [JSN-3].</summary>
        public void Name(string name)
        {
            Text(name);
            Byte(':');
            comma = false;
        }

        public void Member(string name, string value)
        {
            Name(name);
            Text(value);
        }

        public void Member(string name, double value)
        {
            Name(name);
            Number(value);
        }

        public void Member(string name, long value)
        {
            Name(name);
            Integer(value);
        }

        public void BeginObject() { Open('{'); }
        public void EndObject() { Close('}'); }
        public void BeginArray() { Open('['); }
        public void EndArray() { Close(']'); }
        public void Null() { Literal("null"); }
        public void Boolean(bool value) { Literal(value ? "true" : "false"); }

        /// <summary>An array of strings.</summary>
        public void Texts(params string[] values)
        {
            BeginArray();
            foreach (string each in values) Text(each);
            EndArray();
        }

        /// <summary>A number, which reads back as it is [ACC-1].</summary>
        /// <exception cref="ArgumentException">It is not finite [JSN-4].</exception>
        public void Number(double value)
        {
            Separate(Numbers.MaxBytes);
            at += Numbers.Write(value, buffer.AsSpan(at));
        }

        public void Integer(long value)
        {
            Separate(Numbers.MaxBytes);
            at += Numbers.Write(value, buffer.AsSpan(at));
        }

        /// <summary>A string.</summary>
        /// <exception cref="ArgumentException">It has half a surrogate pair [JSN-1].</exception>
        public void Text(string value)
        {
            Separate(6 * value.Length + 2);
            Byte('"');
            for (int i = 0; i < value.Length; i++)
            {
                char each = value[i];
                if (each == '"' || each == '\\') { Byte('\\'); Byte(each); }
                else if (each < 0x20) Control(each);
                else if (each < 0x80) Byte(each);
                else if (each < 0x800) { Byte(0xc0 | each >> 6); Tail(each); }
                else if (!char.IsSurrogate(each)) { Byte(0xe0 | each >> 12); Tail(each >> 6); Tail(each); }
                else
                {
                    if (i + 1 == value.Length || !char.IsSurrogatePair(each, value[i + 1])) throw new ArgumentException("half a surrogate pair at character " + i + " [JSN-1]");
                    int code = char.ConvertToUtf32(each, value[++i]);
                    Byte(0xf0 | code >> 18);
                    Tail(code >> 12);
                    Tail(code >> 6);
                    Tail(code);
                }
            }
            Byte('"');
        }

        void Control(char each)
        {
            Literally("\\u00");
            Byte("0123456789abcdef"[each >> 4]);
            Byte("0123456789abcdef"[each & 15]);
        }

        void Tail(int code) { Byte(0x80 | code & 0x3f); }

        void Byte(int value) { buffer[at++] = (byte)value; }

        void Open(char bracket)
        {
            Separate(1);
            Byte(bracket);
            comma = false;
        }

        void Close(char bracket)
        {
            comma = false;
            Separate(1);
            Byte(bracket);
        }

        void Literal(string word)
        {
            Separate(word.Length);
            Literally(word);
        }

        void Literally(string ascii)
        {
            for (int i = 0; i < ascii.Length; i++) Byte(ascii[i]);
        }

        /// <summary>A comma, where one is due, and room for so many bytes and what stands behind.</summary>
        void Separate(int bytes)
        {
            if (buffer.Length - at < bytes + 2) Array.Resize(ref buffer, Math.Max(2 * buffer.Length, at + bytes + 2));
            if (comma) Byte(',');
            comma = true;
        }
    }
}
